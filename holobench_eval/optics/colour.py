"""sRGB and linear light (IEC 61966-2-1)."""

from __future__ import annotations

import torch
from torch import Tensor


def srgb_encode(linear: Tensor) -> Tensor:
    """Linear light to sRGB values (IEC 61966-2-1).

    The power is taken of at least the branch point, so that the gradient at black is that of the linear branch.

    Parameters
    ----------
    linear
        Any shape, in [0, 1]; values outside are clipped first.

    Returns
    -------
    Tensor
        The same shape, in [0, 1].

    Examples
    --------
    >>> srgb_encode(torch.tensor([0.0, 0.2140, 1.0]))
    tensor([0.0000, 0.5000, 1.0000])
    """
    x = linear.clamp(0.0, 1.0)
    curve = 1.055 * x.clamp_min(0.0031308).pow(1 / 2.4) - 0.055
    return torch.where(x <= 0.0031308, 12.92 * x, curve)


def srgb_decode(encoded: Tensor) -> Tensor:
    """sRGB values to linear light (IEC 61966-2-1).

    Parameters
    ----------
    encoded
        Any shape, in [0, 1]; values outside are clipped first.

    Returns
    -------
    Tensor
        The same shape, in [0, 1].

    Examples
    --------
    >>> srgb_decode(torch.tensor([0.0, 0.5, 1.0]))
    tensor([0.0000, 0.2140, 1.0000])
    """
    x = encoded.clamp(0.0, 1.0)
    curve = ((x + 0.055) / 1.055).pow(2.4)
    return torch.where(x <= 0.04045, x / 12.92, curve)
