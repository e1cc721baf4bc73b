"""Light in free space, computed apart from the package: by direct integration, and by a transform padded eightfold.

The second also does what well-known mistakes do, so that a wrong propagator can be told what is wrong with it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import torch
from torch import Tensor

from ..core.seeds import generator

PITCH, WAVELENGTH = 6.4e-6, 517e-9
TAU = math.tau

Physics = Literal["exact", "paraxial"]
"""Exact scalar diffraction (Goodman, Introduction to Fourier Optics, 3.10), or its Fresnel approximation (4.2)."""

Grid = Literal["fftfreq", "ends", "quarters", "midpoints", "one off"]
"""Frequencies of a transform of M samples; all but the first are mistaken.

ends, quarters, midpoints: ``linspace`` from -1/2p to 1/2p, or from and to a quarter or half of 1/(Mp) within: half a
sample off on average; one off: ``fftshift`` in the place of ``ifftshift``, which differ where M is odd.
"""

INSETS: dict[Grid, float] = {"ends": 0.0, "quarters": 0.25, "midpoints": 0.5}


@dataclass(frozen=True)
class Setting:
    """What a propagator is made for: shape (rows, columns), lengths in metres."""

    shape: tuple[int, int]
    distance: float
    pitch: float = PITCH
    wavelength: float = WAVELENGTH


Rounded = Callable[[Tensor, Tensor, Setting], Tensor]
"""The phase 2 pi z sqrt(1 / lambda^2 - f^2), carrier included, as code forms it in float32."""


Root = Callable[[Tensor, Tensor, float], Tensor]
ROOTS: tuple[tuple[Root, Callable[[float], float]], ...] = (
    (lambda y, x, w: torch.sqrt(1 - w**2 * (y**2 + x**2)), lambda w: TAU / w),
    (lambda y, x, w: torch.sqrt(1 - w**2 * (y**2 + x**2)).float(), lambda w: TAU / w),
    (lambda y, x, w: torch.sqrt(1 - (w * x.float()) ** 2 - (w * y.float()) ** 2), lambda w: TAU / w),
    (lambda y, x, w: torch.sqrt(1 - w**2 * (x.float() ** 2 + y.float() ** 2)), lambda w: TAU / w),
    (lambda y, x, w: torch.sqrt(1 / w**2 - x.float() ** 2 - y.float() ** 2), lambda w: TAU),
    (lambda y, x, w: torch.sqrt(1 / w**2 - (x.float() ** 2 + y.float() ** 2)), lambda w: TAU),
    (lambda y, x, w: torch.sqrt((TAU / w) ** 2 - (TAU * x.float()) ** 2 - (TAU * y.float()) ** 2), lambda w: 1.0),
)
"""The square root as code writes it, of frequencies y and x and wavelength w, and what it is multiplied by."""


def _rounded(root: Root, scale: Callable[[float], float], stepwise: bool, *given: Any) -> Tensor:
    fy, fx, setting = given
    factor, z = scale(setting.wavelength), setting.distance
    values = root(fy, fx, setting.wavelength)
    return values * factor * z if stepwise else values * (factor * z)


def _rounded_paraxial(fy: Tensor, fx: Tensor, setting: Setting) -> Tensor:
    w, z = setting.wavelength, setting.distance
    return TAU / w * z - (math.pi * w * z) * (fx.float() ** 2 + fy.float() ** 2)


Radius = Callable[[Tensor, Tensor], Tensor]

ROUNDED: dict[Physics, list[Rounded]] = {
    "exact": [partial(_rounded, *root, stepwise) for root in ROOTS for stepwise in (False, True)],
    "paraxial": [_rounded_paraxial],
}
"""Ways in which code rounds to single precision: each has errors of its own, which differ from bit to bit."""


@dataclass(frozen=True)
class Transform:
    """How `propagated` computes: samples of the transform in sizes of the field, its frequencies, a band limit.

    rounded: how the phase is formed in single precision, one of `ROUNDED`; in double precision unless given;
    radius, limit: what passes is where this measure of the frequencies is at most the limit [1/m].
    """

    samples: int = 8
    grid: Grid = "fftfreq"
    limited: bool = False  # by Matsushima & Shimobaba, Opt. Express 17, 19662 (2009), Eq. 13
    rounded: Rounded | None = None
    radius: Radius | None = None
    limit: float = math.inf


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
    setting, out = Setting((field.shape[0], field.shape[1]), distance), torch.zeros(len(rows), dtype=torch.complex128)
    y = (rows[:, None] - torch.arange(setting.shape[0])).double() * PITCH
    x = (columns[:, None] - torch.arange(setting.shape[1])).double() * PITCH
    for point in range(len(rows)):
        out[point] = (field * _kernel(y[point], x[point], setting)).sum()
    return out


def sampled_kernel(field: Tensor, setting: Setting) -> Tensor:
    """The sum over source pixels at all pixels, by FFT; wrong where its kernel oscillates faster than they sample."""
    padded = [2 * size for size in setting.shape]
    y, x = (setting.pitch * size * torch.fft.fftfreq(size, dtype=torch.float64) for size in padded)
    spectrum = torch.fft.fft2(field, s=padded) * torch.fft.fft2(_kernel(y, x, setting))
    return torch.fft.ifft2(spectrum)[: setting.shape[0], : setting.shape[1]]


def _kernel(y: Tensor, x: Tensor, setting: Setting) -> Tensor:
    """What a pixel gives to pixels at offsets ``y`` and ``x`` [m], carrier left out; back in time for z < 0."""
    r_squared, z = y[:, None] ** 2 + x**2, abs(setting.distance)
    rho, k = torch.sqrt(r_squared + z**2), 2 * math.pi / setting.wavelength
    amplitude = setting.pitch**2 * z / (setting.wavelength * rho**2)
    kernel = torch.polar(amplitude, k * r_squared / (rho + z) - math.pi / 2)
    kernel = kernel * torch.complex(torch.ones_like(rho), 1 / (k * rho))
    return kernel if setting.distance > 0 else kernel.conj()


RIGHT = Transform()


def propagated(field: Tensor, setting: Setting, physics: Physics = "exact", how: Transform = RIGHT) -> Tensor:
    """The field ``(H, W)`` at the setting's distance, the carrier exp(ikz) left out; complex128.

    With the eightfold padding of `RIGHT` the error is 1e-5 on `white_field` where light spreads less than the field's
    size and 3e-5 where it spreads three times as far.
    """
    height, width = setting.shape
    padded = (how.samples * height, how.samples * width)
    fy, fx = (_frequencies(size, setting.pitch, how.grid) for size in padded)
    f_squared = fy[:, None] ** 2 + fx[None, :] ** 2
    axial = torch.sqrt((1 / setting.wavelength**2 - f_squared).clamp_min(0.0))
    slope = axial + 1 / setting.wavelength if physics == "exact" else 2 / setting.wavelength
    inside = axial > 0
    if how.limited:
        inside &= _below_limit(fy, setting)[:, None] & _below_limit(fx, setting)
    if how.radius is not None:
        inside &= how.radius(fy[:, None], fx) <= how.limit
    phase = -TAU * setting.distance * f_squared / slope
    if how.rounded:
        phase = how.rounded(fy[:, None], fx, setting).float().double()
    transfer = torch.polar(inside.double(), phase)
    spectrum = torch.fft.fft2(field.to(torch.complex128), s=padded)
    return torch.fft.ifft2(spectrum * transfer)[:height, :width]


def _frequencies(size: int, pitch: float, grid: Grid) -> Tensor:
    index = torch.arange(size, dtype=torch.float64)
    if grid in INSETS:
        first = INSETS[grid] / size - 0.5
        centred = (first - 2 * first * index / (size - 1)) / pitch
    else:
        centred = (index - size // 2) / (size * pitch)
    return torch.fft.fftshift(centred) if grid == "one off" else torch.fft.ifftshift(centred)


def _below_limit(frequency: Tensor, setting: Setting) -> Tensor:
    """Where light goes aside by at most half of the transform's window."""
    window = len(frequency) * setting.pitch
    return frequency.abs() * setting.wavelength * math.sqrt((2 * setting.distance / window) ** 2 + 1) <= 1


def difference(image: Tensor, right: Tensor, scale: Tensor | None = None) -> float:
    """Rms of the difference relative to ``scale`` (``right`` unless given), one phase factor of the whole divided out.

    A propagator may keep exp(ikz) or any other constant phase. It may not keep a factor of amplitude: energy is held.
    """
    overlap = torch.vdot(right.flatten(), image.flatten())
    turned = image * (overlap.conj() / overlap.abs()) if overlap.abs() > 0 else image
    return float((turned - right).norm() / (right if scale is None else scale).norm())
