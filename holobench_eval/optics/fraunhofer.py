"""Far-field (Fourier) propagation: one centred FFT."""

from __future__ import annotations

import torch
from torch import Tensor

from .angular_spectrum import check_geometry


class Fraunhofer:
    """The field in the far field, or in the focal plane of a lens (Goodman, sections 4.3 and 5.2).

    Unitary: energy is conserved, and the constant phase and the quadratic phase of the image plane are dropped. The
    origin of the image is at pixel (H // 2, W // 2).

    Parameters
    ----------
    shape
        Rows and columns.
    pitch, wavelength
        Of the pixels and of the light [m].
    distance
        Of propagation, or the focal length [m].

    Attributes
    ----------
    image_pitch
        Of the image, vertical and horizontal [m].

    Examples
    --------
    >>> model = Fraunhofer((64, 32), pitch=8e-6, wavelength=512e-9, distance=0.1)
    >>> [round(1e6 * side) for side in model.image_pitch]
    [100, 200]
    >>> int(model.forward(torch.ones(64, 32, dtype=torch.complex64)).abs().argmax()) == 32 * 32 + 16
    True
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
