"""The beam that meets the panel is not a plane wave of constant amplitude (paper Eq. 7)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor

from ..geometry import Geometry
from ..maps import enlarged
from ..stage import Effect, Stage, percent

if TYPE_CHECKING:
    from ..profile import Profile

FRINGES_AT = 532e-9  # wavelength [m] at which ``fringe_cycles`` is given
COARSEST, SPAN = 0.6, 0.8  # frequency of a fringe system in units of it, and how far it may lie above


@dataclass(frozen=True)
class Illumination(Stage):
    """Gaussian beam, cover-glass fringes, smooth wavefront error and tilt; lengths in panel heights.

    beam_sigma: of the *amplitude* ``exp(-r^2 / (2 sigma^2))`` [panel heights], null for a uniform beam;
    offset: largest offset of the beam's centre [panel heights]; fringes: amplitude modulation of interference fringes
    [share]; fringe_cycles: how many there are [cycles/panel height]; phase_rms: smooth phase error [rad];
    tilt: of the light that falls in, a shift of the picture, vertical and horizontal [cycles/panel height]; power: of
    the laser [relative to what the camera's exposure was set for].
    """

    title: ClassVar[str] = "illumination"
    model: ClassVar[str] = "Gaussian beam, cover-glass fringes, smooth wavefront error, tilt (paper Eq. 7)"

    beam_sigma: Annotated[float, Interval(gt=0)] | None = None
    offset: Annotated[float, Interval(ge=0, le=1)] = 0.0
    fringes: Annotated[float, Interval(ge=0, le=0.5)] = 0.0
    fringe_cycles: Annotated[float, Interval(ge=0, le=200)] = 8.0
    phase_rms: Annotated[float, Interval(ge=0, le=6.3)] = 0.0
    tilt: tuple[float, float] = (0.0, 0.0)
    power: Annotated[float, Interval(gt=0, le=100)] = 1.0

    def effects(self, profile: Profile) -> Iterator[Effect]:
        """Beam, fringes, wavefront and tilt."""
        if "amplitude" in self.maps:
            yield Effect("beam", "amplitude of the beam, as measured")
        if "phase" in self.maps:
            yield Effect("wavefront", "phase of the beam, as measured")
        if self.beam_sigma is not None:
            yield Effect("beam", f"Gaussian beam of {self.beam_sigma:g} panel heights")
        if self.fringes:
            finest = self.fringe_cycles * FRINGES_AT / min(profile.panel.wavelengths) * (COARSEST + SPAN)
            yield Effect("fringes", f"fringes of {percent(self.fringes)}, up to {finest:.0f} cycles a panel height")
        if self.phase_rms:
            yield Effect("wavefront", f"smooth phase of the beam, {self.phase_rms:g} rad rms")
        if any(self.tilt):
            yield Effect("tilt", f"tilt of the beam, {math.hypot(*self.tilt):.2g} cycles a panel height")

    def panel(self, geometry: Geometry) -> Tensor:
        """Complex incident field ``(H, W)``, of unit mean intensity but for a measured one, whatever the power."""
        y, x = geometry.coordinates()
        phase = self.wavefront(geometry) + 2 * math.pi * (self.tilt[0] * y + self.tilt[1] * x)
        if (own := self.map_of("amplitude", geometry.channel)) is not None:
            return torch.polar(enlarged(own, geometry.shape).clamp_min(0), phase).to(torch.complex64)
        amplitude = torch.ones(geometry.shape, dtype=torch.float64)
        if self.beam_sigma is not None:
            draw = geometry.generator("beam centre")
            centre = (2 * torch.rand(2, generator=draw, dtype=torch.float64) - 1) * self.offset
            amplitude *= torch.exp(-((y - centre[0]) ** 2 + (x - centre[1]) ** 2) / (2 * self.beam_sigma**2))
        amplitude *= 1 + self.fringes * self._fringes(geometry)
        amplitude /= amplitude.pow(2).mean().sqrt()
        return torch.polar(amplitude, phase).to(torch.complex64)

    def wavefront(self, geometry: Geometry) -> Tensor:
        """Smooth phase error ``(H, W)`` [rad], without the tilt."""
        if (own := self.map_of("phase", geometry.channel)) is not None:
            return enlarged(own, geometry.shape)
        return self.phase_rms * geometry.smooth_map(2.5, "wavefront")

    def laser(self, channel: int) -> float:
        """Power of a colour, relative to what the camera's exposure was set for."""
        own = self.map_of("power", channel)
        return self.power if own is None else self.power * float(own)

    def _fringes(self, geometry: Geometry) -> Tensor:
        """Two fringe systems in [-1, 1]; the finer the shorter the wavelength, as between two plane surfaces."""
        y, x = geometry.coordinates()
        cycles = self.fringe_cycles * FRINGES_AT / geometry.wavelength
        total = torch.zeros(geometry.shape, dtype=torch.float64)
        for system, share in enumerate((0.6, 0.4)):
            turn, phase, ratio = torch.rand(3, generator=geometry.generator("fringes", system), dtype=torch.float64)
            angle = 2 * math.pi * turn
            frequency = cycles * (COARSEST + SPAN * ratio)
            total += share * torch.cos(
                2 * math.pi * (frequency * (torch.cos(angle) * x + torch.sin(angle) * y) + phase)
            )
        return total
