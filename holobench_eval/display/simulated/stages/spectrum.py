"""The source emits more than one wavelength; the light of different wavelengths adds in intensity (paper 5.1)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
import torch
from annotated_types import Interval, Len
from torch import Tensor

from ..geometry import Geometry
from ..stage import Effect, Stage

if TYPE_CHECKING:
    from ..profile import Profile

Width = Annotated[float, Interval(ge=0, le=6e-8)]
Offset = Annotated[float, Interval(ge=-1e-7, le=1e-7)]
Share = Annotated[float, Interval(gt=0)]
Spectral = Annotated[tuple[tuple[Offset, Share], ...], Len(1, 99)]
FWHM = 2 * math.sqrt(2 * math.log(2))  # full width at half maximum of a Gaussian, in standard deviations


@dataclass(frozen=True)
class Spectrum(Stage):
    """A Gaussian line, or a measured spectrum: an incoherent sum over a few wavelengths.

    width: full width at half maximum of red, green and blue; of a single colour the first [m]; lines: wavelengths that
    stand for it (Gauss-Hermite quadrature), which have to lie closer than a pixel in the image [count]; measured: in
    the place of width, pairs for every colour: offset from the nominal wavelength [m], and share of the power in any
    unit.

    Laser diodes emit over 1 to 5 nm, superluminescent diodes over 5 to 15 nm, light-emitting diodes over 20 to 40 nm.
    The blaze of a display is a grating: a wavelength ``d`` off the nominal one leaves the axis and arrives ``z f d``
    beside it, where f is the frequency of the blaze and z the distance. The panel's stroke falls as 1 / wavelength.
    """

    title: ClassVar[str] = "spectrum"
    model: ClassVar[str] = (
        "wavelengths of the source add in intensity; the blaze spreads them (paper 5.1; Peng et al. 2021)"
    )

    width: tuple[Width, Width, Width] = (0.0, 0.0, 0.0)
    lines: Annotated[int, Interval(ge=1, le=31)] = 3
    measured: tuple[Spectral, ...] = ()

    def effects(self, profile: Profile) -> Iterator[Effect]:
        """How far its lines lie from the nominal wavelengths, and how far the blaze moves them."""
        panel = profile.panel
        colours = [self._offsets(channel) for channel in range(len(panel.wavelengths))]
        reaches = [max(abs(offset) for offset, _ in lines) for lines in colours]
        if any(reaches):
            spread = max(reaches) * panel.distance * math.hypot(*panel.blaze) / panel.pitch**2
            nanometres = "/".join(f"{1e9 * reach:.2g}" for reach in reaches)
            text = f"lines up to {nanometres} nm beside the nominal wavelengths{' (R/G/B)' * (len(colours) > 1)}"
            yield Effect("spectrum", f"{text}, which the blaze moves by up to {spread:.2g} px" if spread else text)

    def spectrum(self, geometry: Geometry) -> Sequence[tuple[float, Geometry]]:
        """The wavelengths of a colour, the one nearest to the nominal wavelength first."""
        return [
            (share, replace(geometry, wavelength=geometry.wavelength + offset, detuning=geometry.detuning + offset))
            for offset, share in self._offsets(geometry.channel)
        ]

    def transmission(self, fy: Tensor, fx: Tensor, geometry: Geometry) -> Tensor | None:
        """The blaze turns a wavelength away from the axis, which shifts its image."""
        if not geometry.detuning or not any(geometry.blaze):
            return None
        y, x = (geometry.distance * geometry.detuning * cycles / geometry.pitch for cycles in geometry.blaze)
        phase = -2 * math.pi * (fy * y + fx * x)
        return torch.polar(torch.ones_like(phase), phase)

    def _offsets(self, channel: int) -> list[tuple[float, float]]:
        """Offset from the nominal wavelength [m] and share of the power of every line, the nearest first."""
        if self.measured:
            total = sum(share for _, share in self.measured[channel])
            pairs = [(offset, share / total) for offset, share in self.measured[channel]]
        elif self.width[channel] and self.lines > 1:
            pairs = gaussian_line(self.width[channel], self.lines)
        else:
            pairs = [(0.0, 1.0)]
        return sorted(pairs, key=lambda pair: (abs(pair[0]), pair[0]))


def gaussian_line(width: float, lines: int) -> list[tuple[float, float]]:
    """Offset [m] and share of the power of ``lines`` wavelengths that stand for a Gaussian line of full width at half
    maximum ``width`` [m], by Gauss-Hermite quadrature."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(lines)
    return list(zip((nodes * width / FWHM).tolist(), (weights / weights.sum()).tolist(), strict=True))
