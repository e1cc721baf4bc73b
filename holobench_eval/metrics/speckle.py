"""Speckle contrast where the picture should be even.

J. W. Goodman, "Speckle Phenomena in Optics" (2007), Eq. 3.11: standard deviation over mean of the intensity.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

VERSION = "1"  # raised whenever a value would change
PATCH = 16
FLATNESS = 0.05
DIMMEST = 0.05


def speckle_contrast(capture: Tensor, target: Tensor) -> float:
    """Mean of std / mean of the captured intensity over the patches where the target is flat and not dark.

    Patches are 16 x 16 px side by side, per channel. A patch counts when the target in it has a mean of at least 0.05
    and a std / mean of at most 0.05, and the capture a positive mean.

    Parameters
    ----------
    capture
        ``(C, H, W)`` linear light in any unit.
    target
        ``(C, H, W)`` linear light in [0, 1].

    Returns
    -------
    float
        About 1 for fully developed speckle, 0 for none; lower is better. NaN where no patch counts.

    Raises
    ------
    ValueError
        Shapes that differ or are smaller than a patch, values that are not finite.

    Examples
    --------
    >>> speckle_contrast(torch.ones(1, 32, 32), torch.ones(1, 32, 32))
    0.0
    """
    if capture.shape != target.shape or capture.ndim != 3:
        raise ValueError(f"expected (C, H, W) twice, got {tuple(capture.shape)} and {tuple(target.shape)}")
    if min(capture.shape[1:]) < PATCH:
        raise ValueError(f"image sides must be at least {PATCH} pixels, got {tuple(capture.shape[1:])}")
    if not (bool(capture.isfinite().all()) and bool(target.isfinite().all())):
        raise ValueError("capture and target must be finite")
    wanted = _patches(target)
    mean = wanted.mean(-1)
    flat = (mean >= DIMMEST) & (wanted.std(-1, correction=0) <= FLATNESS * mean)
    patches = _patches(capture)[flat]
    light = patches.mean(-1)
    lit = light > 0
    if not bool(lit.any()):
        return math.nan
    return float((patches.std(-1, correction=0)[lit] / light[lit]).mean())


def _patches(image: Tensor) -> Tensor:
    """(C, H, W) to (N, PATCH^2); the rest at the right and lower edge is left out."""
    tiles = image.unfold(1, PATCH, PATCH).unfold(2, PATCH, PATCH)
    return torch.flatten(torch.flatten(tiles, 3), 0, 2)
