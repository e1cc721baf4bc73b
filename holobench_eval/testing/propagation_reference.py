"""Light in free space, computed apart from the package: by direct integration, and by a transform padded eightfold."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor

from ..core.seeds import generator

PITCH, WAVELENGTH = 6.4e-6, 517e-9

Physics = Literal["exact", "paraxial"]
"""Exact scalar diffraction (Goodman, Introduction to Fourier Optics, 3.10), or its Fresnel approximation (4.2)."""


@dataclass(frozen=True)
class Setting:
    """What a propagator is made for: shape (rows, columns), lengths in metres."""

    shape: tuple[int, int]
    distance: float
    pitch: float = PITCH
    wavelength: float = WAVELENGTH


def gaussian_beam(
    shape: tuple[int, int], waist: float, tilt: tuple[float, float] = (0.0, 0.0), focus: float | None = None
) -> Tensor:
    """Field ``exp(-r^2 / waist^2)``, if wanted tilted (cycles per pixel) or converging; complex128.

    waist: [m]; focus: distance at which the light converges [m].
    """
    rows = torch.arange(shape[0], dtype=torch.float64) - (shape[0] - 1) / 2
    columns = torch.arange(shape[1], dtype=torch.float64) - (shape[1] - 1) / 2
    radius = (rows[:, None] ** 2 + columns[None, :] ** 2) * PITCH**2
    phase = 2 * math.pi * (tilt[0] * rows[:, None] + tilt[1] * columns[None, :])
    if focus is not None:
        phase = phase - math.pi * radius / (WAVELENGTH * focus)
    return torch.polar(torch.exp(-radius / waist**2), phase.expand_as(radius).contiguous())


def white_field(shape: tuple[int, int], band: float) -> Tensor:
    """Random light of all frequencies up to a share of the band of the pixels, dark towards the edges; complex128.

    At the very end of the band, and at a hard edge, right propagators differ by how they continue the field.
    """
    spectrum = torch.fft.fft2(torch.randn(shape, generator=generator("conformance", "white"), dtype=torch.complex128))
    for axis, size in enumerate(shape):
        inside = torch.fft.fftfreq(size).abs() <= band / 2
        spectrum = spectrum * (inside[:, None] if axis == 0 else inside)
    window = [torch.hann_window(size, periodic=False, dtype=torch.float64) for size in shape]
    return torch.fft.ifft2(spectrum) * torch.outer(*window)


def direct_sum(field: Tensor, rows: Tensor, columns: Tensor, distance: float) -> Tensor:
    """First Rayleigh-Sommerfeld integral as a plain sum over source pixels, at some output pixels; complex128.

    Goodman, section 3.5: ``exp(i k rho) / (i lambda rho)`` times the obliquity z / rho, times (1 + i / (k rho)).
    The carrier exp(ikz) is left out.
    """
    out, k = torch.zeros(len(rows), dtype=torch.complex128), 2 * math.pi / WAVELENGTH
    y = (rows[:, None] - torch.arange(field.shape[0])).double() * PITCH
    x = (columns[:, None] - torch.arange(field.shape[1])).double() * PITCH
    for point in range(len(rows)):
        r_squared = y[point][:, None] ** 2 + x[point] ** 2
        rho = torch.sqrt(r_squared + distance**2)
        amplitude = PITCH**2 * distance / (WAVELENGTH * rho**2)
        kernel = torch.polar(amplitude, k * r_squared / (rho + distance) - math.pi / 2)
        out[point] = (field * kernel * torch.complex(torch.ones_like(rho), 1 / (k * rho))).sum()
    return out


def propagated(field: Tensor, setting: Setting, physics: Physics = "exact") -> Tensor:
    """The field ``(H, W)`` at the setting's distance, the carrier exp(ikz) left out; complex128.

    The error is 1e-5 on `white_field` where light spreads less than the field's size, and 3e-5 where it spreads three
    times as far.
    """
    height, width = setting.shape
    padded = (8 * height, 8 * width)
    fy, fx = (torch.fft.fftfreq(size, setting.pitch, dtype=torch.float64) for size in padded)
    f_squared = fy[:, None] ** 2 + fx[None, :] ** 2
    axial = torch.sqrt((1 / setting.wavelength**2 - f_squared).clamp_min(0.0))
    slope = axial + 1 / setting.wavelength if physics == "exact" else 2 / setting.wavelength
    transfer = torch.polar((axial > 0).double(), -2 * math.pi * setting.distance * f_squared / slope)
    spectrum = torch.fft.fft2(field.to(torch.complex128), s=padded)
    return torch.fft.ifft2(spectrum * transfer)[:height, :width]


def difference(image: Tensor, right: Tensor) -> float:
    """Rms of the difference relative to ``right``, one phase factor of the whole divided out.

    A propagator may keep exp(ikz) or any other constant phase. It may not keep a factor of amplitude: energy is held.
    """
    overlap = torch.vdot(right.flatten(), image.flatten())
    turned = image * (overlap.conj() / overlap.abs()) if overlap.abs() > 0 else image
    return float((turned - right).norm() / right.norm())
