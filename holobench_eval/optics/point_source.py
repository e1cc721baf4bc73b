"""Point-source propagation: convolution with the free-space impulse response (paper Eq. 3-4)."""

from __future__ import annotations

import math
from functools import lru_cache

import torch
from torch import Tensor

from .angular_spectrum import check_geometry
from .convolution import Convolution
from .kernel.sizes import fast_size
from .transfer import TransferFunction, transfer_function

TAPER = 0.1
"""Half width of the soft edge at the sampling limit, relative to it."""


class PointSource(Convolution):
    """Every pixel is a point source, summed by FFT (Chakravarthula et al. 2020, Eq. 3 and 4).

    The convolution is linear, not circular. The kernel exp(ik rho) / (i lambda rho) is cut where it oscillates faster
    than the pixels sample it, since beyond that it would make ghosts; its phase is formed in float64 without the
    carrier exp(ikz).

    Parameters
    ----------
    shape
        Rows and columns.
    pitch, wavelength
        Of the pixels and of the light [m].
    distance
        Negative to propagate back, not zero [m].
    dtype, device
        Those of the transfer function, and with it of the fields.

    Raises
    ------
    ValueError
        A geometry without a meaning, or no distance.

    Examples
    --------
    >>> PointSource((32, 32), pitch=6.4e-6, wavelength=517e-9, distance=5e-3).forward(torch.ones(32, 32)).shape
    torch.Size([32, 32])
    """

    def __init__(
        self,
        shape: tuple[int, int],
        pitch: float,
        wavelength: float,
        distance: float,
        dtype: torch.dtype = torch.complex64,
        device: torch.device | str = "cpu",
    ) -> None:
        check_geometry(shape, pitch, wavelength, None)
        if distance == 0:
            raise ValueError("the point-source kernel needs a distance that is not zero")
        transfer = _kernel_transfer((shape[0], shape[1]), pitch, wavelength, distance, dtype, torch.device(device))
        super().__init__((shape[0], shape[1]), transfer)


def impulse_response(y: Tensor, x: Tensor, wavelength: float, distance: float) -> Tensor:
    """The kernel of a point source, carrier removed (Chakravarthula et al. 2020, Eq. 3).

    Parameters
    ----------
    y, x
        Lateral offsets [m].
    wavelength, distance
        Lengths [m]; a negative distance gives the conjugate, the field that converges.

    Returns
    -------
    Tensor
        complex128 [1/m^2].
    """
    z = abs(distance)
    r_squared = (y**2 + x**2).double()
    rho = torch.sqrt(r_squared + z**2)
    path = r_squared / (rho + z)
    amplitude = 1 / (wavelength * rho)
    kernel = torch.polar(amplitude, 2 * math.pi / wavelength * path - math.pi / 2)
    return kernel if distance > 0 else kernel.conj()


@lru_cache(maxsize=8)
def _kernel_transfer(
    shape: tuple[int, int], pitch: float, wavelength: float, distance: float, dtype: torch.dtype, device: torch.device
) -> TransferFunction:
    padded = tuple(fast_size(2 * size - 1) for size in shape)
    offsets = []
    for size, samples in zip(shape, padded, strict=True):
        index = torch.arange(samples, dtype=torch.float64, device=device)
        index = torch.where(index < size, index, index - samples)
        offsets.append(index * pitch)
    y, x = offsets[0][:, None], offsets[1][None, :]
    kernel = impulse_response(y, x, wavelength, distance) * pitch**2
    kernel = kernel * _resolved(y, pitch, wavelength, distance) * _resolved(x, pitch, wavelength, distance)
    return transfer_function(torch.fft.fft2(kernel).to(dtype))


def _resolved(offset: Tensor, pitch: float, wavelength: float, distance: float) -> Tensor:
    """1 where the kernel oscillates slower than the pixels sample it, 0 where faster; soft, or the edge rings."""
    local = offset.abs() / (wavelength * torch.sqrt(offset**2 + distance**2)) * (2 * pitch)
    edge = ((local - 1 + TAPER) / (2 * TAPER)).clamp(0.0, 1.0)
    return 0.5 * (1 + torch.cos(math.pi * edge))
