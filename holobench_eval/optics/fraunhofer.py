"""Far-field (Fourier) propagation: one centred FFT."""

from __future__ import annotations

import torch
from torch import Tensor

from .angular_spectrum import check_geometry


class Fraunhofer:
    """The field in the far field, or in the focal plane of a lens (Goodman, sections 4.3 and 5.2).

    shape: (H, W) pixels; pitch, wavelength: metres; distance: metres of propagation, or the focal length.
    The image has ``image_pitch`` (vertical, horizontal) metres a pixel and its origin at pixel (H // 2, W // 2).
    Unitary: energy is conserved, and the constant phase and the quadratic phase of the image plane are dropped.
    """

    def __init__(self, shape: tuple[int, int], pitch: float, wavelength: float, distance: float) -> None:
        check_geometry(shape, pitch, wavelength, None)
        self.shape = shape
        self.image_pitch = (
            wavelength * abs(distance) / (shape[0] * pitch),
            wavelength * abs(distance) / (shape[1] * pitch),
        )

    def forward(self, field: Tensor) -> Tensor:
        """Propagate ``(..., H, W)`` complex to the far field."""
        centred = torch.fft.ifftshift(field, dim=(-2, -1))
        return torch.fft.fftshift(torch.fft.fft2(centred, norm="ortho"), dim=(-2, -1))

    def adjoint(self, field: Tensor) -> Tensor:
        """The adjoint, which is the inverse."""
        centred = torch.fft.ifftshift(field, dim=(-2, -1))
        return torch.fft.fftshift(torch.fft.ifft2(centred, norm="ortho"), dim=(-2, -1))
