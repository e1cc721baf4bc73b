"""Zernike polynomials, orthonormal on the unit disc in Noll's order (Noll, J. Opt. Soc. Am. 66, 207, 1976)."""

from __future__ import annotations

import math
from collections.abc import Mapping

import torch
from torch import Tensor

NAMES = {
    "piston": 1,
    "tilt_x": 2,
    "tilt_y": 3,
    "defocus": 4,
    "astigmatism_45": 5,
    "astigmatism_0": 6,
    "coma_y": 7,
    "coma_x": 8,
    "trefoil_y": 9,
    "trefoil_x": 10,
    "spherical": 11,
}


def noll(index: int) -> tuple[int, int]:
    """Orders of Noll's single index (Noll 1976, Table I).

    Parameters
    ----------
    index
        From 1, which is piston.

    Returns
    -------
    n, m
        Radial and azimuthal order; m < 0 is a sine term.

    Raises
    ------
    ValueError
        An index below 1.

    Examples
    --------
    >>> noll(4), noll(8)
    ((2, 0), (3, 1))
    """
    if index < 1:
        raise ValueError(f"Noll's index starts at 1, got {index}")
    n = 0
    first = index - 1
    while first > n:
        n += 1
        first -= n
    m = (-1) ** index * ((n % 2) + 2 * ((first + ((n + 1) % 2)) // 2))
    return n, m


def zernike(index: int, y: Tensor, x: Tensor) -> Tensor:
    """A polynomial of Noll's orthonormal set (Noll 1976, Eq. 1 and 2).

    Parameters
    ----------
    index
        Noll's, from 1.
    y, x
        Points of the plane, one shape; the unit disc is the pupil.

    Returns
    -------
    Tensor
        The same shape; its rms over the disc is 1.

    Examples
    --------
    >>> zernike(NAMES["defocus"], torch.zeros(1), torch.ones(1))
    tensor([1.7321])
    """
    n, m = noll(index)
    order = abs(m)
    rho = torch.sqrt(x * x + y * y)
    radial = torch.zeros_like(rho)
    for k in range((n - order) // 2 + 1):
        weight = (-1) ** k * math.factorial(n - k)
        weight /= math.factorial(k) * math.factorial((n + order) // 2 - k) * math.factorial((n - order) // 2 - k)
        radial = radial + weight * rho ** (n - 2 * k)
    if m == 0:
        return math.sqrt(n + 1) * radial
    theta = torch.atan2(y, x)
    angular = torch.cos(order * theta) if m > 0 else torch.sin(order * theta)
    return math.sqrt(2 * (n + 1)) * radial * angular


def wavefront(waves: Mapping[str, float], y: Tensor, x: Tensor) -> Tensor:
    """Sum of named Zernike terms.

    Parameters
    ----------
    waves
        Rms over the unit disc of each term, by its name in ``NAMES`` [waves].
    y, x
        Points of the plane; the unit disc is the pupil.

    Returns
    -------
    Tensor
        The shape of ``y`` and ``x`` broadcast [rad].
    """
    total = torch.zeros_like(y + x)
    for name, amount in waves.items():
        total = total + 2 * math.pi * amount * zernike(NAMES[name], *torch.broadcast_tensors(y, x))
    return total
