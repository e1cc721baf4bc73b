"""Fresnel propagation: the paraxial expansion of the angular spectrum."""

from __future__ import annotations

import math
from functools import lru_cache

import torch

from .angular_spectrum import check_geometry
from .convolution import Convolution, frequencies, iris
from .padding import Padding, padded_shape
from .transfer import TransferFunction, transfer_function


class Fresnel(Convolution):
    """Paraxial transfer-function propagation, ``exp(-i pi lambda z f^2)``, carrier removed (Goodman, section 4.2).

    The difference to ``AngularSpectrum`` is the model-approximation error of Chakravarthula et al. 2020, Eq. 8.

    Parameters
    ----------
    shape, pitch, wavelength, distance, pupil, padding, dtype, device
        As those of ``AngularSpectrum``.

    Raises
    ------
    ValueError
        A geometry without a meaning, or a wrong padding.

    Examples
    --------
    >>> Fresnel((32, 32), pitch=6.4e-6, wavelength=517e-9, distance=1e-3).forward(torch.ones(32, 32)).shape
    torch.Size([32, 32])
    """

    def __init__(
        self,
        shape: tuple[int, int],
        pitch: float,
        wavelength: float,
        distance: float,
        pupil: float | None = None,
        padding: Padding = None,
        dtype: torch.dtype | None = None,
        device: torch.device | str = "cpu",
    ) -> None:
        check_geometry(shape, pitch, wavelength, pupil)
        if dtype is None:
            dtype = torch.complex128 if padding == "reference" else torch.complex64
        padded = padded_shape(shape, pitch, wavelength, distance, pupil, padding)
        super().__init__(
            (shape[0], shape[1]),
            _paraxial_transfer(padded, pitch, wavelength, distance, pupil, dtype, torch.device(device)),
        )


@lru_cache(maxsize=24)
def _paraxial_transfer(
    padded: tuple[int, int],
    pitch: float,
    wavelength: float,
    distance: float,
    pupil: float | None,
    dtype: torch.dtype,
    device: torch.device,
) -> TransferFunction:
    fy, fx = frequencies(padded, pitch, device)
    phase = -math.pi * wavelength * distance * (fy**2 + fx**2)
    return transfer_function(torch.polar(iris(fy, fx, pitch, pupil), phase).to(dtype))
