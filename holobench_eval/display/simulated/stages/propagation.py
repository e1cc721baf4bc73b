"""From the panel through the iris, with the true distance, wavelength and aberrations (paper Eq. 8)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor

from ....optics.angular_spectrum import angular_spectrum_phase
from ....optics.convolution import frequencies, iris
from ....optics.zernike import NAMES, wavefront
from ..geometry import Geometry
from ..stage import Effect, Stage, percent
from .crosstalk import sample_positions

if TYPE_CHECKING:
    from ..profile import Profile


@dataclass(frozen=True)
class Propagation(Stage):
    """What separates the light's way from the nominal one.

    distance_error, wavelength_error: of the true one from the nominal one [relative]; aberration: over the iris (or
    over the band when there is none; in a Fourier plane, over the panel), by Zernike name, such as ``defocus`` or
    ``coma_x`` [rms waves at 517 nm];
    pupil_shift: of the iris, rows and columns [share of its radius]; obstruction: radius of an opaque disc in its
    middle [share of its radius].
    """

    title: ClassVar[str] = "propagation and iris"
    model: ClassVar[str] = (
        "true distance, wavelength and Zernike aberrations, and a soft circular iris around the first order, in one "
        "transfer function (paper Eq. 8, Fig. 4)"
    )

    distance_error: Annotated[float, Interval(ge=-0.5, le=0.5)] = 0.0
    wavelength_error: Annotated[float, Interval(ge=-0.1, le=0.1)] = 0.0
    aberration: Mapping[str, float] = field(default_factory=dict)
    pupil_shift: tuple[float, float] = (0.0, 0.0)
    obstruction: Annotated[float, Interval(ge=0, lt=1)] = 0.0

    def effects(self, profile: Profile) -> Iterator[Effect]:
        """Defocus and aberrations."""
        if self.distance_error or self.wavelength_error:
            wavelength = f"{percent(self.wavelength_error)} of the wavelength"
            yield Effect("defocus", f"wrong by {percent(self.distance_error)} of the distance, {wavelength}")
        measured = self.maps["aberration"].T.tolist() if "aberration" in self.maps else []
        for name, radians in zip(NAMES, measured, strict=False):
            if any(radians) and not self.aberration.get(name):
                text = ", ".join(f"{value:.3g}" for value in radians)
                yield Effect(name, f"aberration {name.replace('_', ' ')}, {text} rad rms, as measured")
        for name, waves in self.aberration.items():
            if waves:
                yield Effect(name, f"aberration {name.replace('_', ' ')}, {waves:g} waves rms at 517 nm")

    def panel(self, geometry: Geometry) -> Tensor | None:
        """Phasor ``(H, W)`` of errors on the way to a Fourier plane, see ``lens_phase``; None in a Fresnel plane."""
        if geometry.image_pitch is None:
            return None
        phase = self.lens_phase(geometry)
        return torch.polar(torch.ones_like(phase), phase).to(torch.complex64)

    def lens_phase(self, geometry: Geometry) -> Tensor:
        """Defocus and aberration before a lens of focal length f, as a phase at the panel ``(H, W)`` [rad].

        Light that leaves the panel at r from the axis arrives at the angle r / f, so that a camera at f (1 + e) sees
        the paraxial phase -pi e r^2 / (lambda f) of the way f e (Goodman, Introduction to Fourier Optics, 5.2). The
        panel is the pupil: its corners are the edge of the unit disc.
        """
        y, x = (axis * geometry.shape[0] for axis in geometry.coordinates())
        wavelength, radius = geometry.wavelength * (1 + self.wavelength_error), math.hypot(*geometry.shape) / 2
        defocus = -math.pi * self.distance_error * geometry.pitch**2 / (wavelength * geometry.distance)
        aberration = wavefront(self.aberration, *torch.broadcast_tensors(y / radius, x / radius))
        measured = self._measured(y / radius, x / radius, geometry)
        return defocus * (y * y + x * x) + aberration * (517e-9 / geometry.wavelength) + measured

    def transfer(
        self, geometry: Geometry, padded: tuple[int, int], pupil: float | None, fraction: tuple[float, float]
    ) -> Tensor:
        """Transfer function on the padded grid, from ``fraction[0]`` to ``fraction[1]`` of the way, complex64.

        The iris and the aberrations act once, on the part of the way that starts at the panel.
        """
        fy, fx = frequencies(padded, geometry.pitch)
        wavelength = geometry.wavelength * (1 + self.wavelength_error)
        distance = geometry.distance * (1 + self.distance_error) * (fraction[1] - fraction[0])
        f_squared = fy**2 + fx**2
        phase = angular_spectrum_phase(f_squared, wavelength, distance)
        amplitude = (f_squared < 1 / wavelength**2).double()
        if fraction[0] == 0:
            amplitude = amplitude * self.iris(fy, fx, geometry, pupil)
            phase = phase + self.pupil_phase(fy, fx, geometry, pupil)
        return torch.polar(amplitude, phase).to(torch.complex64)

    def iris(self, fy: Tensor, fx: Tensor, geometry: Geometry, pupil: float | None) -> Tensor:
        """Amplitude at spatial frequencies [1/m]; the obstruction is told of the whole band where there is no iris."""
        radius = (pupil or 1.0) / (2 * geometry.pitch)
        y, x = fy - self.pupil_shift[0] * radius, fx - self.pupil_shift[1] * radius
        amplitude = iris(y, x, geometry.pitch, pupil)
        if self.obstruction:
            amplitude = amplitude * (1 - iris(y, x, geometry.pitch, self.obstruction * (pupil or 1.0)))
        return amplitude

    def pupil_phase(self, fy: Tensor, fx: Tensor, geometry: Geometry, pupil: float | None) -> Tensor:
        """Aberration [rad] at spatial frequencies [1/m]; constant beyond the iris, where no light passes."""
        scale = 2 * geometry.pitch / (pupil or 1.0)
        y, x = torch.broadcast_tensors(fy * scale, fx * scale)
        beyond = torch.sqrt(y * y + x * x).clamp_min(1.1) / 1.1
        aberration = wavefront(self.aberration, y / beyond, x / beyond) * (517e-9 / geometry.wavelength)
        return aberration + self._measured(y, x, geometry)

    def _measured(self, y: Tensor, x: Tensor, geometry: Geometry) -> Tensor | float:
        """What the map adds at points of which the pupil is the unit disc [rad]."""
        own = self.map_of("aberration", geometry.channel)
        if own is None:
            return 0.0
        waves = {name: value / (2 * math.pi) for name, value in zip(NAMES, own.tolist(), strict=True) if value}
        return wavefront(waves, y, x) * (torch.hypot(y, x) <= 1)


def sample_weights(
    padded: tuple[int, int], samples: int, blaze: tuple[float, float], hold: bool
) -> tuple[Tensor, Tensor]:
    """Weights that add the spectra of the sub-samples to that of the panel, ``(samples, padded)`` for each axis.

    Each sub-sample sits off its pixel's centre and, with ``hold``, is a small square (a sinc in frequency). The
    spectra are those of fields whose carrier ``blaze`` [cycles per pixel] has been taken off pixel by pixel, so the
    light of frequency f left the panel at f + blaze.
    """
    axes = []
    for size, carrier in zip(padded, blaze, strict=True):
        f = torch.fft.fftfreq(size, dtype=torch.float64) + carrier
        envelope = torch.sinc(f / samples) if hold else torch.ones_like(f)
        angle = -2 * math.pi * torch.tensor(sample_positions(samples), dtype=torch.float64)[:, None] * f
        weights = torch.polar(envelope.expand_as(angle).contiguous(), angle) / samples
        axes.append(weights.to(torch.complex64))
    return axes[0], axes[1]
