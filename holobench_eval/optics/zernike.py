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
    """Radial order n and azimuthal order m of Noll's single index (1 is piston); m < 0 is a sine term."""
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
    """The polynomial of Noll's ``index`` at points of the plane (unit disc); its rms over the disc is 1."""
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
    """Sum of named terms, each given by its rms in waves over the unit disc; returns radians."""
    total = torch.zeros_like(y + x)
    for name, amount in waves.items():
        total = total + 2 * math.pi * amount * zernike(NAMES[name], *torch.broadcast_tensors(y, x))
    return total
