"""Quantities that describe a display, defined once, for a bench whose truth is known and for a model of it.

A display that is seen only through its images has gauge freedoms: a constant phase may sit in the look-up table or in
the beam, a curved beam focuses as a defocused lens does. Each quantity here is chosen so that such freedoms cancel.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from torch import Tensor

from ..optics.phase import TAU
from ..optics.zernike import NAMES, zernike

MODES = ("defocus", "astigmatism_45", "astigmatism_0", "coma_y", "coma_x", "trefoil_y", "trefoil_x", "spherical")
"""Zernike polynomials of the estimates, see ``optics.zernike``; registration hides piston and tilts."""
HAZELESS = 0.02  # share of haze below which its reach has no meaning
DARK = 1e-3  # share of unmodulated light below which its phase has no meaning
DISC_POINTS = 129  # along the diameter


@dataclass(frozen=True)
class Estimate:
    """One number about a display. colour: index of the channel, None for all of them; error: what it is off by at most,
    with a probability of 90 %, infinite where no capture shows it; None for that of the quantity."""

    name: str
    colour: int | None
    value: float
    unit: str
    error: float | None = None


@dataclass(frozen=True)
class Quantity:
    """What a number means. error: what an estimate from a few dozen captures is expected to be off by, at most."""

    words: str
    unit: str
    error: float


QUANTITIES: Mapping[str, Quantity] = {
    "lut_exponent": Quantity("exponent of the look-up table, phase over gray level", "", 0.04),
    "phase_gain": Quantity("stroke of the look-up table, share of a turn, mean over the panel", "", 0.03),
    "crosstalk": Quantity("width of the crosstalk, standard deviation", "px", 0.04),
    "undiffracted_fraction": Quantity("share of the light that no phase modulates, dead area included", "", 0.03),
    "undiffracted_phase": Quantity("phase of that light against the light at gray level 0", "rad", 0.15),
    "light": Quantity("light from the panel that the camera counts, share of the nominal", "", 0.05),
    "stray_share": Quantity("share of the light that arrives as haze", "", 0.15),
    "stray_reach": Quantity("standard deviation of the haze", "panel heights", 0.1),
    **{
        name: Quantity(f"Zernike {name.replace('_', ' ')}, with the curvature of the beam", "waves rms", 0.015)
        for name in MODES
    },
}
"""Every quantity of a display."""


def estimate(name: str, colour: int | None, value: float) -> Estimate:
    """A number of one of the ``QUANTITIES``."""
    return Estimate(name, colour, float(value), QUANTITIES[name].unit)


@dataclass(frozen=True)
class Stroke:
    """Phase of a gray level: ``2 pi (gain v^exponent + offset)``, v the level as a share of a turn."""

    exponent: float
    gain: float
    offset: float


def stroke(levels: Tensor, phase: Tensor) -> Stroke:
    """The law of ``Stroke`` nearest to a look-up table, both ``(n,)``: levels in [0, 1], phase [rad].

    A constant phase is not seen in an image, so it is left free and returned. Exact for a table that follows the law.
    """
    level: NDArray[np.float64] = levels.detach().double().numpy()
    turns: NDArray[np.float64] = phase.detach().double().numpy() / TAU

    def line(exponent: float) -> tuple[list[float], float]:
        basis = np.stack([level**exponent, np.ones_like(level)], 1)
        coefficients = np.linalg.lstsq(basis, turns, rcond=None)[0]
        return coefficients.tolist(), float(np.square(basis @ coefficients - turns).sum())

    exponent = float(
        minimize_scalar(lambda x: line(x)[1], bounds=(0.2, 5), method="bounded", options={"xatol": 1e-6}).x
    )
    gain, offset = line(exponent)[0]
    return Stroke(exponent, gain, offset)


def undiffracted(ratio: complex, colour: int) -> list[Estimate]:
    """Share and phase of unmodulated light whose amplitude is ``ratio`` times that of the light at gray level 0.

    Powers are added as if the two did not interfere, so that without dead area the share is ``ZeroOrder.fraction``.
    The dead area of the pixels reflects in phase with the beam and cannot be told from the zero order, so the ratio
    holds their coherent sum. The phase is left out where there is next to no such light.
    """
    share = abs(ratio) ** 2 / (1 + abs(ratio) ** 2)
    estimates = [estimate("undiffracted_fraction", colour, share)]
    if share > DARK:
        estimates.append(estimate("undiffracted_phase", colour, math.atan2(ratio.imag, ratio.real)))
    return estimates


def stray(share: float, reach: float, colour: int) -> list[Estimate]:
    """Share and reach of the haze; the reach is left out where there is next to no haze."""
    found = [estimate("stray_share", colour, share)]
    return [*found, estimate("stray_reach", colour, reach)] if share > HAZELESS else found


def disc() -> tuple[Tensor, Tensor]:
    """Points (y, x), each ``(n,)``, spread evenly over the unit disc: the iris, whose edge is at 1."""
    side = torch.linspace(-1, 1, DISC_POINTS, dtype=torch.float64)
    y, x = torch.meshgrid(side, side, indexing="ij")
    inside = torch.hypot(y, x) <= 1
    return y[inside], x[inside]


def zernike_waves(phase: Tensor) -> dict[str, float]:
    """Coefficients [waves rms] of ``MODES`` in a phase [rad] at the points of ``disc``."""
    y, x = disc()
    named = ("piston", "tilt_x", "tilt_y", *MODES)
    basis = torch.stack([zernike(NAMES[name], y, x) for name in named], 1)
    waves = torch.linalg.lstsq(basis, phase[:, None]).solution[:, 0] / TAU
    return dict(zip(named, waves.tolist(), strict=True))


def focusing(beam: Tensor, reach: float) -> Tensor:
    """Phase [rad] at the points of ``disc`` that acts as the curvature of the beam does, once images are registered.

    beam: phase ``(H, W)`` [rad] on the panel; reach: pixels that light at the edge of the iris moves to the side on its
    way. A beam of phase x^T Q x / 2 turns the light of frequency f by Q x / 2 pi more, which moves and stretches the
    picture by I + lambda z Q / 2 pi; registration takes that out, and what stays is the phase (lambda z)^2 f^T Q f / 2
    in the iris: that of the beam at the distance lambda z f from its centre. Only the second order of the beam, by
    least squares over the panel, does this alike everywhere.
    """
    height, width = beam.shape
    rows = torch.arange(height, dtype=torch.float64) - (height - 1) / 2
    columns = torch.arange(width, dtype=torch.float64) - (width - 1) / 2
    y, x = torch.meshgrid(rows / height, columns / height, indexing="ij")
    basis = torch.stack([y * y, y * x, x * x, y, x, torch.ones_like(y)], -1).reshape(-1, 6)
    curvature = torch.linalg.lstsq(basis, beam.double().reshape(-1, 1)).solution[:3, 0] * (reach / height) ** 2
    v, u = disc()
    return curvature[0] * v * v + curvature[1] * v * u + curvature[2] * u * u


def reach(wavelength: float, distance: float, pitch: float, pupil: float | None) -> float:
    """How far [px] light at the edge of the iris moves to the side (paraxial); lengths in metres."""
    return wavelength * distance * (pupil or 1.0) / (2 * pitch**2)


def joined(estimates: Iterable[Estimate], truths: Iterable[Estimate]) -> list[dict[str, object]]:
    """Estimates beside the truth of the same name and colour, None where there is none, as plain values for a file.

    error: that of the estimate, else of the quantity; None for one that is not in ``QUANTITIES``, and with ``seen``
    false for one that no capture shows.
    """
    known = {(item.name, item.colour): item.value for item in truths}
    return [
        {
            "name": item.name,
            "colour": item.colour,
            "unit": item.unit,
            "value": _finite(item.value),
            "truth": _finite(known.get((item.name, item.colour))),
            "error": _finite(_error(item)),
            **({"seen": False} if _error(item) == math.inf else {}),
        }
        for item in estimates
    ]


def _error(item: Estimate) -> float | None:
    known = QUANTITIES.get(item.name)
    return item.error if item.error is not None or known is None else known.error


def _finite(value: float | None) -> float | None:
    """Six digits, more than any estimate has; None for NaN and infinity."""
    return None if value is None or not math.isfinite(value) else float(f"{value:.6g}")
