"""How far a learned display can be trusted. Not in the paper."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from ..common import matched
from .samples import Approximator, Sample


def fidelity(approximator: Approximator, samples: Sequence[Sample]) -> dict[str, float]:
    """On unseen images, PSNR [dB] of the picture that was predicted, of the one captured, and of the one against the
    other: a prediction that is better than its capture is the network being exploited."""
    rows = []
    for sample in samples:
        with torch.no_grad():
            predicted = approximator.predicted(sample)
        capture = matched(sample.capture, sample.target)
        pairs = ((predicted, sample.target), (sample.capture, sample.target), (predicted, capture))
        rows.append([matched_psnr(*pair) for pair in pairs])
    means = torch.tensor(rows).mean(0).tolist()
    return dict(zip(("predicted_psnr", "captured_psnr", "fidelity_psnr"), means, strict=True))


def matched_psnr(image: Tensor, target: Tensor) -> float:
    """PSNR [dB] of an image ``(C, h, w)`` at the brightness of its target."""
    error = (matched(image, target).clamp(0, 1) - target.clamp(0, 1)).square().mean()
    return float(-10 * torch.log10(error.clamp_min(1e-12)))
