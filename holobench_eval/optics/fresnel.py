"""Fresnel propagation: the paraxial expansion of the angular spectrum."""

from __future__ import annotations

import math
from functools import lru_cache

import torch

from .angular_spectrum import AngularSpectrum, Optics
from .convolution import frequencies, iris
from .padding import Padding
from .transfer import TransferFunction, transfer_function


class Fresnel(AngularSpectrum):
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

    @staticmethod
    def _transfer(optics: Optics, padding: Padding, dtype: torch.dtype, device: torch.device) -> TransferFunction:
        return _paraxial_transfer(optics, optics.padded(padding), dtype, device)


@lru_cache(maxsize=24)
def _paraxial_transfer(
    optics: Optics, padded: tuple[int, int], dtype: torch.dtype, device: torch.device
) -> TransferFunction:
    fy, fx = frequencies(padded, optics.pitch, device)
    phase = -math.pi * optics.wavelength * optics.distance * (fy**2 + fx**2)
    return transfer_function(torch.polar(iris(fy, fx, optics.pitch, optics.pupil), phase).to(dtype))
