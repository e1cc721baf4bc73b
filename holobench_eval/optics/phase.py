"""Phase tools: wrap, quantise, linear ramp (blaze), quadratic lens."""

from __future__ import annotations

import math

import torch
from torch import Tensor

TAU = 2 * math.pi


def wrap(phase: Tensor) -> Tensor:
    """Phase [rad] modulo 2 pi, in [0, 2 pi)."""
    wrapped = torch.remainder(phase, TAU)
    # remainder of a tiny negative number rounds up to 2 pi itself
    return torch.where(wrapped >= TAU, torch.zeros_like(wrapped), wrapped)


def gray_level(phase: Tensor, bits: int) -> Tensor:
    """The nearest of ``2^bits`` gray levels of a phase [rad]; 2^bits levels span 2 pi, so 0 and 2^bits - 1 differ."""
    levels = 2**bits
    return (phase * (levels / TAU)).round_().remainder_(levels)


def quantise(phase: Tensor, bits: int) -> Tensor:
    """Phase [rad] wrapped to [0, 2 pi) and rounded to ``2^bits`` levels (paper section 3.2)."""
    return gray_level(phase, bits) * (TAU / 2**bits)


def blaze(
    shape: tuple[int, int],
    cycles_per_pixel: tuple[float, float],
    dtype: torch.dtype = torch.float32,
    device: torch.device | str = "cpu",
) -> Tensor:
    """Linear phase ramp ``(H, W)`` [rad] of (vertical, horizontal) cycles per pixel (paper section 5.1)."""
    rows = torch.arange(shape[0], dtype=torch.float64, device=device)
    columns = torch.arange(shape[1], dtype=torch.float64, device=device)
    turns = cycles_per_pixel[0] * rows[:, None] + cycles_per_pixel[1] * columns[None, :]
    return (TAU * torch.remainder(turns, 1.0)).to(dtype)


def lens(
    shape: tuple[int, int],
    pitch: float,
    wavelength: float,
    focal_length: float,
    dtype: torch.dtype = torch.float32,
    device: torch.device | str = "cpu",
) -> Tensor:
    """Thin-lens phase ``-pi r^2 / (lambda f)`` ``(H, W)`` [rad], centred on the panel; lengths in metres.

    Goodman, Introduction to Fourier Optics, section 5.1. A positive focal length converges.
    """
    y = (torch.arange(shape[0], dtype=torch.float64, device=device) - (shape[0] - 1) / 2) * pitch
    x = (torch.arange(shape[1], dtype=torch.float64, device=device) - (shape[1] - 1) / 2) * pitch
    return (-math.pi * (y[:, None] ** 2 + x[None, :] ** 2) / (wavelength * focal_length)).to(dtype)
