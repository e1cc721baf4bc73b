"""A propagator of one's own in NumPy: ``holoeval conformance docs/propagators/mine.py:MyPropagator``."""

import numpy as np


class MyPropagator:
    """The angular spectrum, padded to twice the size, with the band limit of Matsushima & Shimobaba (2009)."""

    def __init__(self, shape, pitch, wavelength, distance):
        self.shape, self.padded = shape, (2 * shape[0], 2 * shape[1])
        fy, fx = np.fft.fftfreq(self.padded[0], pitch)[:, None], np.fft.fftfreq(self.padded[1], pitch)
        axial = np.sqrt(np.maximum(1 / wavelength**2 - fy**2 - fx**2, 0))
        self.transfer = np.exp(2j * np.pi * distance * (axial - 1 / wavelength))
        for f, size in zip((fy, fx), self.padded, strict=True):
            limit = 1 / (wavelength * np.hypot(1, 2 * distance / (size * pitch)))
            self.transfer = self.transfer * (abs(f) <= limit)

    def forward(self, field):
        """Propagate a complex field ``(H, W)``."""
        height, width = self.shape
        return np.fft.ifft2(np.fft.fft2(field, self.padded) * self.transfer)[:height, :width]

    def adjoint(self, field):
        """Propagate back; without this method the checks of gradients do not apply to NumPy."""
        height, width = self.shape
        return np.fft.ifft2(np.fft.fft2(field, self.padded) * self.transfer.conj())[:height, :width]
