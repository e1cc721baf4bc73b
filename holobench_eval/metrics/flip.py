"""LDR-FLIP, by its authors' own implementation (package flip-evaluator).

P. Andersson et al., "FLIP: a difference evaluator for alternating images", Proc. ACM Comput. Graph. Interact. Tech. 3
(2020).
"""

from __future__ import annotations

import torch
from flip_evaluator import evaluate
from torch import Tensor

from .base import Metric, as_rgb, paired


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
    means = []
    for test, reference in zip(x, y, strict=True):
        arrays = [side.permute(1, 2, 0).contiguous().numpy() for side in (reference, test)]
        means.append(evaluate(*arrays, "LDR", inputsRGB=True, applyMagma=False)[1])
    return torch.tensor(means, dtype=image.dtype, device=image.device).reshape(image.shape[:-3])


METRIC = Metric("flip", "1", "lower", 0.0, ("srgb",), flip, differentiable=False, title="FLIP")
