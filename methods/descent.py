"""What descent methods share: the best phase so far, and a decaying step."""

from __future__ import annotations

import math
from dataclasses import InitVar, dataclass, field

import torch
from torch import Tensor


@dataclass
class Best:
    """The phase of the least loss seen, per image; a copy, since optimisers change their phase in place."""

    start: InitVar[Tensor]
    phase: Tensor = field(init=False)
    loss: Tensor = field(init=False)

    def __post_init__(self, start: Tensor) -> None:
        self.phase = start.detach().clone()
        self.loss = start.new_full((len(start),), torch.inf)

    def update(self, loss: Tensor, phase: Tensor) -> None:
        """Keep ``phase`` ``(B, H, W)`` where ``loss`` ``(B,)`` is the least so far."""
        better = loss < self.loss
        if better.all():
            self.phase.copy_(phase.detach())
        else:
            self.phase[better] = phase.detach()[better]
        self.loss = torch.where(better, loss.detach(), self.loss)


def cosine_decay(step: float, progress: float) -> float:
    """A step that falls from ``step`` to zero along half a cosine, of which the share ``progress`` is done."""
    return step * (1 + math.cos(math.pi * progress)) / 2
