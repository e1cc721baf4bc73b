"""Multi-scale structural similarity.

Z. Wang, E. P. Simoncelli, A. C. Bovik, "Multi-scale structural similarity for image quality assessment",
Asilomar Conf. Signals, Systems and Computers (2003).
"""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

from ..imaging.shifts import mirrored
from .base import Metric, paired
from .ssim import RADIUS, LocalStatistics

EXPONENTS = (0.0448, 0.2856, 0.3001, 0.2363, 0.1333)
_WINDOW = 2 * RADIUS
SMALLEST_MS_SSIM = _WINDOW * 2 ** (len(EXPONENTS) - 1) + 1


class FixedMsSsim:
    """``ms_ssim`` against a target that stays, (C, H, W) or (B, C, H, W): its own statistics are computed once.

    count: how many scales, the finest ones; the exponents of fewer than all are enlarged to the same sum.
    """

    def __init__(self, target: Tensor, count: int = len(EXPONENTS)) -> None:
        self.target, self.smallest = target, _WINDOW * 2 ** (count - 1) + 1
        enlarged = sum(EXPONENTS) / sum(EXPONENTS[:count])
        self.exponents = [enlarged * exponent for exponent in EXPONENTS[:count]]
        self.is_last = [False] * (count - 1) + [True]
        _, side = paired(target, target, smallest=self.smallest)
        self.scales = []
        for last in self.is_last:
            self.scales.append(LocalStatistics(mirrored(side, RADIUS) if last else side))
            side = functional.avg_pool2d(side, 2)

    def __call__(self, image: Tensor) -> Tensor:
        """The value of an image of the target's shape, as ``ms_ssim`` gives it."""
        x, _ = paired(image, self.target, smallest=self.smallest)
        value = x.new_ones(x.shape[0])
        for last, scale, exponent in zip(self.is_last, self.scales, self.exponents, strict=True):
            entire, structure = scale.means(mirrored(x, RADIUS) if last else x)
            mean = entire if last else structure
            # The power of zero has an infinite gradient, so zero is a branch of its own.
            value = value * torch.where(mean > 0, torch.where(mean > 0, mean, 1.0).pow(exponent), 0.0)
            x = functional.avg_pool2d(x, 2)
        return value.reshape(image.shape[:-3])


def fitting_scales(shape: tuple[int, int]) -> int:
    """How many scales of MS-SSIM a picture ``(h, w)`` has room for, at most all: each needs a window and a pixel.

    Examples
    --------
    >>> [fitting_scales((side, 200)) for side in (161, 160, 52, 10)]
    [5, 4, 3, 0]
    """
    return sum(min(shape) > _WINDOW * 2**scale for scale in range(len(EXPONENTS)))


def ms_ssim(image: Tensor, target: Tensor) -> Tensor:
    """Product of mean contrast-structure terms at four scales and of mean SSIM at the fifth, to the paper's exponents.

    The windows are those of ``ssim``; a scale is half the one before by 2x2 means; the means go over pixels and
    channels, and a negative mean counts as zero. As in torchmetrics, whose value this equals, the coarsest SSIM is
    averaged over the entire image, mirrored at its edges, and the other terms over the windows that lie in the image.

    Parameters
    ----------
    image, target
        ``(C, H, W)`` or ``(B, C, H, W)`` in [0, 1], sides of at least 161 px.

    Returns
    -------
    Tensor
        Scalar or ``(B,)``; higher is better, identical images give 1.

    Raises
    ------
    ValueError
        Wrong shapes, types or values; see ``base.paired``.
    """
    paired(image, target, smallest=SMALLEST_MS_SSIM)
    return FixedMsSsim(target)(image)


METRIC = Metric(
    "ms_ssim", "1", "higher", 1.0, ("linear", "amplitude", "srgb"), ms_ssim, smallest=SMALLEST_MS_SSIM, title="MS-SSIM"
)
