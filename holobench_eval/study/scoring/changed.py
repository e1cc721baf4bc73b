"""Changes of a hologram that display and model have to answer, the same for all methods; see ``metrics.control``.

Any change here is a new version of that metric.
"""

from __future__ import annotations

import torch
from torch import Tensor

from ...core.seeds import generator
from ...metrics.base import gaussian_blur
from ...metrics.control import HALF

PATCH_SIDE = 0.2  # of the picture's shorter side
PHASE_RMS = 0.5  # rad
PHASE_WIDTH = 8.0  # px, of the Gaussian that smooths noise: 16 px apart, its correlation is 1/e


def changed_target(target: Tensor, change: str, *names: object) -> Tensor:
    """A copy of a target ``(C, h, w)`` without the light of its left or right half, whichever has more of it; or with a
    square patch, at a place by ``names``, that is white, or black where it was bright."""
    target, (height, width) = target.clone(), target.shape[-2:]
    if change == HALF:
        left, right = target[..., : width // 2], target[..., width // 2 :]
        (left if left.sum() >= right.sum() else right).zero_()
        return target
    side = round(PATCH_SIDE * min(height, width))
    down, along = torch.rand(2, generator=generator("control", change, *names)).tolist()
    top, start = int(down * (height - side + 1)), int(along * (width - side + 1))
    patch = target[..., top : top + side, start : start + side]
    patch.fill_(float(patch.mean() < 0.5))
    return target


def moved_phase(phase: Tensor, *names: object) -> Tensor:
    """A phase ``(C, H, W)`` [rad] plus smooth noise by ``names`` in the middle of the panel, half as high and as wide;
    the same in all colours."""
    height, width = phase.shape[-2:]
    noise = torch.randn((1, 1, height, width), generator=generator("control", "phase", *names), dtype=torch.float64)
    rows, columns = (torch.hann_window(length // 2, periodic=False, dtype=torch.float64) for length in (height, width))
    middle = slice(height // 4, height // 4 + len(rows)), slice(width // 4, width // 4 + len(columns))
    smooth = gaussian_blur(noise, PHASE_WIDTH)[0, 0][middle] * rows[:, None] * columns
    moved = phase.clone()
    moved[..., *middle] += (PHASE_RMS / smooth.square().mean().sqrt() * smooth).to(phase)
    return moved
