"""Models of a display with a veil, without training: the one that knows it, a tone curve, and none of it."""

from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from holobench_eval.methods.calibrated.terms import spread

SHARE, REACH = 0.6, 0.2  # of the light; of the panel's height
LEVEL = 0.3  # of the veil where the picture is as usual


def light(phase: Tensor, bench: Any) -> Tensor:
    """Nominal intensity ``(B, C, H, W)`` of a phase ``(B, C, H, W)`` in the unit of captures."""
    fields = [bench.spec.propagator(c).forward(torch.exp(1j * phase[:, c])) for c in range(phase.shape[1])]
    return torch.stack(fields, 1).abs().square() / bench.light.view(-1, 1, 1)


@dataclass(frozen=True)
class Ideal:
    """Predicts the ideal image; its own hologram is always the same."""

    def solve(self, target: Tensor, bench: Any) -> Tensor:
        return torch.zeros(*target.shape[:2], *bench.spec.shape)

    def predict(self, phase: Tensor, bench: Any) -> Tensor:
        return bench.spec.region.crop(light(phase, bench))


@dataclass(frozen=True)
class Veil(Ideal):
    """Knows the veil."""

    def predict(self, phase: Tensor, bench: Any) -> Tensor:
        whole = light(phase, bench)
        rows, columns = (spread(side, torch.tensor([REACH * whole.shape[-2]])) for side in whole.shape[-2:])
        return bench.spec.region.crop((1 - SHARE) * whole + SHARE * (rows @ whole @ columns.mT))


@dataclass(frozen=True)
class Tone(Ideal):
    """Takes the veil for a light that is always there."""

    def predict(self, phase: Tensor, bench: Any) -> Tensor:
        return (1 - SHARE) * super().predict(phase, bench) + SHARE * LEVEL
