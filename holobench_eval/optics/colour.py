"""sRGB and linear light (IEC 61966-2-1)."""

from __future__ import annotations

import torch
from torch import Tensor


def srgb_encode(linear: Tensor) -> Tensor:
    """Linear light in [0, 1] to sRGB values in [0, 1]; values outside are clipped first. Any shape.

    The power is taken of at least the branch point, so that the gradient at black is that of the linear branch.
    """
    x = linear.clamp(0.0, 1.0)
    curve = 1.055 * x.clamp_min(0.0031308).pow(1 / 2.4) - 0.055
    return torch.where(x <= 0.0031308, 12.92 * x, curve)


def srgb_decode(encoded: Tensor) -> Tensor:
    """Values in sRGB, [0, 1], in [0, 1] to linear light in [0, 1]; values outside are clipped first. Any shape."""
    x = encoded.clamp(0.0, 1.0)
    curve = ((x + 0.055) / 1.055).pow(2.4)
    return torch.where(x <= 0.04045, x / 12.92, curve)
