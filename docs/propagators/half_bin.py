"""A mistake that much public hologram code shares: ``linspace`` in the place of ``fftfreq``."""

import math

import torch


class HalfBin:
    """Angular spectrum, padded to twice the size and band-limited, its frequencies half a sample off."""

    def __init__(self, shape, pitch, wavelength, distance):
        self.shape, self.padded = shape, [2 * size for size in shape]
        ends = 1 / (2 * pitch)
        fy, fx = (torch.linspace(-ends, ends, size, dtype=torch.float64) for size in self.padded)
        limits = [1 / (wavelength * math.hypot(1, 2 * distance / (size * pitch))) for size in self.padded]
        inside = (fy.abs() <= limits[0])[:, None] & (fx.abs() <= limits[1])
        phase = 2 * math.pi * distance * torch.sqrt(1 / wavelength**2 - fy[:, None] ** 2 - fx**2)
        self.transfer = torch.fft.ifftshift(torch.polar(inside.double(), phase))

    def forward(self, field):
        """Propagate a complex field ``(H, W)``."""
        height, width = self.shape
        return torch.fft.ifft2(torch.fft.fft2(field, s=self.padded) * self.transfer)[:height, :width]
