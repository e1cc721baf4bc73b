"""What a method may know about a display, and what a display gives back."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import torch
from torch import Tensor

from ..optics import AngularSpectrum
from ..optics.convolution import frequencies
from .simulated.stages.eye import eye_phase
from .simulated.stages.lens import Matrix


@dataclass(frozen=True)
class Region:
    """The scored window of the panel, in panel pixels; loss and score both use exactly this window."""

    top: int
    left: int
    height: int
    width: int

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) in pixels."""
        return self.height, self.width

    def crop(self, image: Tensor) -> Tensor:
        """The window of an image of panel size, ``(..., H, W) -> (..., h, w)``; a view."""
        return image[..., self.top : self.top + self.height, self.left : self.left + self.width]

    def clear_around(self, image: Tensor) -> Tensor:
        """An image of panel size or larger, ``(..., H, W)``, set to zero outside the window, in place."""
        bottom, right = self.top + self.height, self.left + self.width
        for outside in (image[..., : self.top, :], image[..., bottom:, :], image[..., : self.left], image[..., right:]):
            outside.zero_()
        return image

    def embed(self, image: Tensor, shape: tuple[int, int]) -> Tensor:
        """A panel-sized image with ``image`` in the window and zeros elsewhere, ``(..., h, w) -> (..., H, W)``."""
        panel = image.new_zeros((*image.shape[:-2], *shape))
        self.crop(panel).copy_(image)
        return panel


@dataclass(frozen=True)
class DisplaySpec:
    """Nominal optics of a display: all that a method may know about it.

    Lengths are in metres. ``pupil`` is the diameter of the iris as a fraction of the panel's band 1/pitch
    (None: no iris). The blaze that an off-axis display adds to every phase, and the re-centring of its image,
    belong to the display, so the nominal model is on axis for every method. ``eye``: that of the viewer, where its
    prescription is known; see ``stages.eye``.
    """

    name: str
    shape: tuple[int, int]
    pitch: float
    wavelengths: tuple[float, ...]
    distance: float
    bits: int
    pupil: float | None
    region: Region
    eye: Matrix = (0.0, 0.0, 0.0)

    def propagator(
        self, channel: int, dtype: torch.dtype = torch.complex64, device: torch.device | str = "cpu"
    ) -> AngularSpectrum:
        """The ideal propagator of a colour channel, panel to image plane (cached)."""
        return _propagator(self, channel, dtype, torch.device(device))


@lru_cache(maxsize=16)
def _propagator(spec: DisplaySpec, channel: int, dtype: torch.dtype, device: torch.device) -> AngularSpectrum:
    wavelength = spec.wavelengths[channel]
    model = AngularSpectrum(
        shape=spec.shape,
        pitch=spec.pitch,
        wavelength=wavelength,
        distance=spec.distance,
        pupil=spec.pupil,
        dtype=dtype,
        device=device,
    )
    if any(spec.eye):
        fy, fx = frequencies(model.padded_shape, spec.pitch, device)
        seen = eye_phase(spec.eye, fy, fx, wavelength, spec.distance)
        model.transfer = model.transfer * torch.polar(torch.ones_like(seen), seen).to(dtype)
    return model


@dataclass(frozen=True)
class Capture:
    """One colour-sequential camera capture, as the camera gives it.

    frame: ``(C, Hs, Ws)`` sensor counts (DN), float32; dark, white: dark level and saturation level in DN;
    gain: per channel, DN above dark that light as strong as the mean incident light on the panel would give.
    """

    frame: Tensor
    dark: float
    white: float
    gain: tuple[float, ...]

    def linear(self) -> Tensor:
        """``(C, Hs, Ws)`` intensity in units of the mean incident intensity on the panel; dark subtracted in float."""
        gain = torch.tensor(self.gain, dtype=torch.float32, device=self.frame.device).view(-1, 1, 1)
        return (self.frame - self.dark) / gain

    @property
    def saturated(self) -> float:
        """Fraction of saturated samples."""
        return float((self.frame >= self.white).float().mean())


class Display(Protocol):
    """Anything that shows a phase and gives back a capture: a simulated bench, a real one, a learned network."""

    @property
    def spec(self) -> DisplaySpec:
        """Nominal optics, public."""
        ...

    def capture(self, phase: Tensor) -> Capture:
        """Show ``phase`` ``(C, H, W)`` [rad, any range: the display wraps it] and photograph the image plane."""
        ...
