"""Whether the circles that register a camera can be told apart on a display, by its nominal optics."""

from __future__ import annotations

from ..core.errors import UserError
from ..imaging.grid import SMALLEST_REGION, fiducial
from .api import DisplaySpec

COARSEST = 0.75  # of the circles' spacing: at 0.65 the grid is seen on the ideal display, at 0.95 it is not


def refuse_far(spec: DisplaySpec, distance: float) -> None:
    """UserError for a distance at which the circles run into each other.

    A panel of N pixels of pitch p resolves ``wavelength z / (N p)`` at the distance z (Goodman, Introduction to Fourier
    Optics, 4.4). distance: that of the full panel [m], as the display's file has it.
    """
    if spec.plane == "fourier" or min(spec.region.shape) < SMALLEST_REGION:  # sharp, or too small, at any distance
        return
    spot = max(spec.wavelengths) * spec.distance / (min(spec.shape) * spec.pitch**2)
    limit = COARSEST * fiducial(spec.region.shape).spacing
    if spot > limit:
        rows, columns = spec.shape
        raise UserError(
            f"panel.distance of '{spec.name}', {distance:g} m, is too far for {rows} x {columns} pixels: they resolve "
            f"{spot:.0f} px there, and registration needs {limit:.0f}; up to {distance * limit / spot:.2g} m works, or "
            "more on a larger panel"
        )
