"""LDR-FLIP, by its authors' own implementation (package flip-evaluator).

P. Andersson et al., "FLIP: a difference evaluator for alternating images", Proc. ACM Comput. Graph. Interact. Tech. 3
(2020).
"""

from __future__ import annotations

import numpy as np
import torch
from flip_evaluator import evaluate
from numpy.typing import NDArray
from torch import Tensor

from .base import Metric, as_rgb, paired

LARGEST_AT_ONCE = 2**21  # pixels, those of 1080 x 1920; larger images are compared in strips, which take less memory
STRIP = 2**19  # pixels
REACH = 32  # rows, more than the filters reach each way at 67 pixels a degree


def flip(image: Tensor, target: Tensor) -> Tensor:
    """Mean FLIP error for low dynamic range at the default viewing condition of 67 pixels a degree.

    Parameters
    ----------
    image, target
        ``(C, H, W)`` or ``(B, C, H, W)`` in [0, 1], sRGB encoded, C = 1 or 3; gray is taken as three
        equal channels.

    Returns
    -------
    Tensor
        Scalar or ``(B,)`` without gradient; lower is better, from 0 (identical) to 1.

    Raises
    ------
    ValueError
        Wrong shapes, types or values; see ``base.paired``.
    """
    x, y = (as_rgb(side.detach().clamp(0, 1).float().cpu()) for side in paired(image, target))
    in_strips = x.shape[-2] * x.shape[-1] > LARGEST_AT_ONCE
    means = [_mean_of_strips(*pair) if in_strips else _evaluated(*pair)[1] for pair in zip(y, x, strict=True)]
    return torch.tensor(means, dtype=image.dtype, device=image.device).reshape(image.shape[:-3])


def _evaluated(reference: Tensor, test: Tensor) -> tuple[NDArray[np.float32], float]:
    """The errors ``(H, W, 1)`` of an image (3, H, W), and their mean."""
    arrays = [side.permute(1, 2, 0).contiguous().numpy() for side in (reference, test)]
    errors, mean, _ = evaluate(*arrays, "LDR", inputsRGB=True, applyMagma=False)
    return errors, mean


def _mean_of_strips(reference: Tensor, test: Tensor) -> float:
    height, width = test.shape[1:]
    total, step = 0.0, max(1, STRIP // width)
    for top in range(0, height, step):
        first, bottom = max(0, top - REACH), min(height, top + step)
        errors, _ = _evaluated(reference[:, first : bottom + REACH], test[:, first : bottom + REACH])
        total += float(errors[top - first : bottom - first].sum(dtype=np.float64))
    return total / (height * width)


METRIC = Metric("flip", "1", "lower", 0.0, ("srgb",), flip, title="FLIP")
