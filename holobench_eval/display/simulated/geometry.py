"""What every stage needs to know about the panel it works on."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from ...core.seeds import generator


@dataclass(frozen=True)
class Geometry:
    """One colour channel of a bench: shape (H, W) [px], pitch, wavelength and nominal distance [m], and its seed.

    samples: sub-samples per pixel and axis at the panel. seed: names that every fixed random pattern hangs from.
    blaze: (vertical, horizontal) cycles per pixel that the optical axis follows; detuning: of the wavelength from the
    one that axis and panel are set for [m]; image_pitch: of an image in a Fourier plane [m], where distance is the
    focal length; None in a Fresnel plane.
    """

    shape: tuple[int, int]
    pitch: float
    wavelength: float
    distance: float
    samples: int
    channel: int
    seed: tuple[object, ...]
    blaze: tuple[float, float] = (0.0, 0.0)
    detuning: float = 0.0
    image_pitch: float | None = None

    def generator(self, *names: object) -> torch.Generator:
        """Named random numbers of this bench, the same for every channel unless ``names`` hold the channel."""
        return generator(*self.seed, *names)

    def coordinates(self) -> tuple[Tensor, Tensor]:
        """Panel coordinates as a column and a row: pixels from the centre divided by the panel's height."""
        height, width = self.shape
        y = (torch.arange(height, dtype=torch.float64) - (height - 1) / 2) / height
        x = (torch.arange(width, dtype=torch.float64) - (width - 1) / 2) / height
        return y[:, None], x[None, :]

    def smooth_map(self, cycles: float, *names: object) -> Tensor:
        """A smooth random map ``(H, W)`` of zero mean and unit rms: plane waves up to ``cycles`` per panel height."""
        draw = self.generator("smooth", *names)
        y, x = self.coordinates()
        total = torch.zeros(self.shape, dtype=torch.float64)
        for _ in range(24):
            fy, fx, phase = torch.rand(3, generator=draw, dtype=torch.float64).tolist()
            angle = 2 * torch.pi * (cycles * ((2 * fy - 1) * y + (2 * fx - 1) * x) + phase)
            total += torch.cos(angle)
        total -= total.mean()
        return total / total.pow(2).mean().sqrt().clamp_min(1e-12)
