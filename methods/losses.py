"""Losses on intensity that phase retrieval minimises, by name.

Each takes the scaled intensity s I and the target T, linear light ``(B, h, w)``, and gives ``(B,)``. They are
divided by the target's own size, so that neither brightness nor pixel count changes the step of an optimiser,
and a batch does not mix its images. The scale s is the closed form of ``common.intensity_scale``, recomputed
for every phase: learning it by gradient descent is slower and worse.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import torch
from torch import Tensor
from torch.nn import functional

from ..core.errors import UserError
from ..metrics.ms_ssim import SMALLEST_MS_SSIM, ms_ssim
from ..optics.linear import linear
from .common import TINY, intensity_scale, safe_amplitude

LossName = Literal["intensity_l2", "amplitude_l2", "intensity_l1", "huber", "ms_ssim"]
Loss = Callable[[Tensor, Tensor], Tensor]


def _relative(error: Tensor, size: Tensor) -> Tensor:
    return error.sum(dim=(-2, -1)) / size.sum(dim=(-2, -1)).clamp_min(TINY)


def _dot(a: Tensor, b: Tensor) -> Tensor:
    """Sum of products per image, ``(B, h, w)`` twice to ``(B,)``."""
    total: Tensor = torch.linalg.vecdot(a.flatten(1), b.flatten(1))
    return total


def intensity_l2(intensity: Tensor, target: Tensor) -> Tensor:
    """Squared error of intensity over the target's squared intensity (Chakravarthula et al. 2020, Eq. 12).

    ``min over s of sum((s I - T)^2) / sum(T^2)``; at that s its slope in I is ``2 s (s I - T) / sum(T^2)``. Written out
    since it is in every step of the default method, where a recorded graph costs as much as the FFTs.
    """
    given = intensity.detach()
    scale = _dot(given, target) / _dot(given, given).clamp_min(TINY)
    size = _dot(target, target).clamp_min(TINY)
    error = torch.mul(given, scale[:, None, None]).sub_(target)
    factor = 2 * scale / size
    return linear(
        lambda _: _dot(error, error) / size,
        lambda grad, kept, slope: kept * (grad * slope)[:, None, None],
        intensity,
        error,
        factor,
    )


def amplitude_l2(intensity: Tensor, target: Tensor) -> Tensor:
    """Squared error of amplitude over the target's intensity (Peng et al. 2020); its own closed-form scale."""
    amplitude, wanted = safe_amplitude(intensity), target.clamp_min(0).sqrt()
    scaled = intensity_scale(amplitude, wanted) * amplitude
    return _relative((scaled - wanted).square(), target)


def intensity_l1(intensity: Tensor, target: Tensor) -> Tensor:
    """Absolute error of intensity over the target's intensity."""
    scaled = intensity_scale(intensity, target) * intensity
    return _relative((scaled - target).abs(), target)


def huber(intensity: Tensor, target: Tensor) -> Tensor:
    """Huber's loss of intensity, quadratic to an error of 0.1 and linear above, over the target's squared intensity."""
    scaled = intensity_scale(intensity, target) * intensity
    return _relative(2 * functional.huber_loss(scaled, target, reduction="none", delta=0.1), target.square())


def ms_ssim_l1(intensity: Tensor, target: Tensor) -> Tensor:
    """0.84 (1 - MS-SSIM) + 0.16 L1, the mixture of Zhao et al., IEEE Trans. Comput. Imaging 3, 47 (2017).

    MS-SSIM is that of clipped intensity, as it is scored; L1 sees what is clipped. Raises UserError for a region
    that is too small for five scales.
    """
    if min(target.shape[-2:]) < SMALLEST_MS_SSIM:
        size = " x ".join(str(side) for side in target.shape[-2:])
        raise UserError(
            f"loss 'ms_ssim' needs a region of at least {SMALLEST_MS_SSIM} x {SMALLEST_MS_SSIM} px, got {size}"
        )
    scaled = intensity_scale(intensity, target) * intensity
    structure = ms_ssim(scaled.clamp(0, 1)[:, None], target[:, None])
    return 0.84 * (1 - structure) + 0.16 * intensity_l1(intensity, target)


LOSSES: dict[LossName, Loss] = {
    "intensity_l2": intensity_l2,
    "amplitude_l2": amplitude_l2,
    "intensity_l1": intensity_l1,
    "huber": huber,
    "ms_ssim": ms_ssim_l1,
}
