"""What one-pass networks are made of: what they see of a colour, and how their phases are encoded."""

from __future__ import annotations

import torch
from torch import Tensor

from ..double_phase import encode

LARGEST = 0.999  # amplitude that is encoded; the slope of the arc cosine is infinite at 1


def coloured(images: Tensor) -> Tensor:
    """Images ``(C, n, H, W)``, a row a colour, with a plane for each colour, one where it is that of the row and else
    zero, ``(C, n + C, H, W)``."""
    colours = len(images)
    planes = torch.eye(colours, dtype=images.dtype, device=images.device)[:, :, None, None]
    return torch.cat([images, planes.expand(colours, colours, *images.shape[-2:])], 1)


def bounded(phase: Tensor) -> Tensor:
    """A phase [rad] that a network gives, brought smoothly into (-pi, pi), where the publications cut it."""
    return torch.pi * torch.tanh(phase / torch.pi)


def double_phase(field: Tensor) -> Tensor:
    """Double phase encoding of a field ``(C, H, W)`` whose gradient is finite, to phase ``(C, H, W)`` [rad]."""
    return encode(field, largest=LARGEST)
