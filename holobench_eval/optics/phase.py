"""Phase tools: wrap, quantise, linear ramp (blaze), quadratic lens, refocus."""

from __future__ import annotations

import math

import torch
from torch import Tensor

TAU = 2 * math.pi
BEYOND_RADIANS = 20.0  # whole numbers of radians that reach this far do not occur
HIGHEST_LEVEL = 65536.0
FARTHEST = 2.0**18  # rad; beyond it the steps of float32 are larger than a level of 8 bits, 2 pi / 256

Matrix = tuple[float, float, float]
"""A symmetric 2 x 2 matrix: along rows (vertical), along columns (horizontal), and between the two."""


def wrap(phase: Tensor) -> Tensor:
    """Phase modulo 2 pi.

    Parameters
    ----------
    phase
        Any shape [rad].

    Returns
    -------
    Tensor
        The same shape, in [0, 2 pi) [rad].

    Examples
    --------
    >>> wrap(torch.tensor([-1.0, 7.0])) / TAU
    tensor([0.8408, 0.1141])
    """
    wrapped = torch.remainder(phase, TAU)
    # remainder of a tiny negative number rounds up to 2 pi itself
    return torch.where(wrapped >= TAU, torch.zeros_like(wrapped), wrapped)


def gray_level(phase: Tensor, bits: int) -> Tensor:
    """The nearest of ``2^bits`` gray levels of a phase [rad]; 2^bits levels span 2 pi, so 0 and 2^bits - 1 differ."""
    levels = 2**bits
    return (phase * (levels / TAU)).round_().remainder_(levels)


def farthest(values: Tensor) -> float:
    """The largest magnitude among real numbers of any shape."""
    low, high = values.detach().aminmax()
    return max(-float(low), float(high))


def are_levels(values: Tensor) -> bool:
    """Whether real numbers of any shape are a panel's levels and no radians: all are whole, some go beyond three turns,
    and they differ (a constant shifts no light, whatever its unit). False for a panel of so few levels as 16."""
    low, high = values.detach().aminmax()
    in_range = BEYOND_RADIANS < farthest(values) <= HIGHEST_LEVEL
    return in_range and bool(low < high) and bool((values == values.round()).all())


def quantise(phase: Tensor, bits: int) -> Tensor:
    """Phase wrapped and rounded to the levels of a panel (Chakravarthula et al. 2020, section 3.2).

    Parameters
    ----------
    phase
        Any shape [rad].
    bits
        Of the panel, whose ``2^bits`` levels span 2 pi: the first and the last differ.

    Returns
    -------
    Tensor
        The same shape, in [0, 2 pi) [rad].

    Examples
    --------
    >>> quantise(torch.tensor([0.1, 1.6, 6.2]), bits=2) / TAU
    tensor([0.0000, 0.2500, 0.0000])
    """
    return gray_level(phase, bits) * (TAU / 2**bits)


def blaze(
    shape: tuple[int, int],
    cycles_per_pixel: tuple[float, float],
    dtype: torch.dtype = torch.float32,
    device: torch.device | str = "cpu",
) -> Tensor:
    """Linear phase ramp that moves an image off the zero order (Chakravarthula et al. 2020, section 5.1).

    Parameters
    ----------
    shape
        Rows and columns.
    cycles_per_pixel
        Vertical and horizontal carrier.
    dtype, device
        Those of the result.

    Returns
    -------
    Tensor
        ``(H, W)``, in [0, 2 pi) [rad].

    Examples
    --------
    >>> blaze((1, 4), (0.0, 0.25)) / TAU
    tensor([[0.0000, 0.2500, 0.5000, 0.7500]])
    """
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
    """Thin-lens phase ``-pi r^2 / (lambda f)``, centred on the panel (Goodman, Introduction to Fourier Optics, 5.1).

    Parameters
    ----------
    shape
        Rows and columns.
    pitch, wavelength
        Of the pixels and of the light [m].
    focal_length
        Positive for a lens that converges [m].
    dtype, device
        Those of the result.

    Returns
    -------
    Tensor
        ``(H, W)`` [rad].
    """
    y = (torch.arange(shape[0], dtype=torch.float64, device=device) - (shape[0] - 1) / 2) * pitch
    x = (torch.arange(shape[1], dtype=torch.float64, device=device) - (shape[1] - 1) / 2) * pitch
    return (-math.pi * (y[:, None] ** 2 + x[None, :] ** 2) / (wavelength * focal_length)).to(dtype)


def refocus(focus: Matrix, fy: Tensor, fx: Tensor, wavelength: float, distance: float) -> Tensor:
    """Phase that light gains between the image plane and a plane that lies at another distance in each meridian.

    Paraxial (Goodman, Introduction to Fourier Optics, 4.2): ``-pi lambda z f^T focus f`` for the plane at
    z (1 + ``focus``).

    Parameters
    ----------
    focus
        How much further away the plane is, relative to the distance.
    fy, fx
        Spatial frequencies [1/m].
    wavelength, distance
        Of the light and of the image plane [m].

    Returns
    -------
    Tensor
        The shape of ``fy`` and ``fx`` broadcast [rad].
    """
    rows, columns, cross = focus
    return -math.pi * wavelength * distance * (rows * fy * fy + columns * fx * fx + 2 * cross * fy * fx)
