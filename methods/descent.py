"""What descent methods share: Adam on a phase, the best phase so far, and a decaying step."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import InitVar, dataclass, field

import torch
from torch import Tensor

from ..core.graphs import is_recorded, repeated

# Phase (B, H, W) [rad] to the loss (B,) and its gradient (B, H, W) times the pixels of the panel: a factor that keeps
# it far above Adam's epsilon, whatever the panel's size.
Evaluate = Callable[[Tensor], tuple[Tensor, Tensor]]


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
        loss, phase = loss.detach(), phase.detach()
        better = loss < self.loss
        if is_recorded(phase.device):
            torch.where(better[:, None, None], phase, self.phase, out=self.phase)
        elif better.all():  # half the time of the line above
            self.phase.copy_(phase)
        else:
            self.phase[better] = phase[better]
        self.loss.copy_(torch.where(better, loss, self.loss))


def adam(
    start: Tensor,
    evaluate: Evaluate,
    iterations: int,
    step: float,
    *,
    decay: bool = False,
    done: Callable[[Tensor], bool] = lambda loss: False,
    fused: bool = False,
) -> Tensor:
    """The phase of the least loss that Adam sees on its way from ``start`` ``(B, H, W)`` [rad].

    step: its rate [rad], constant or (``decay``) falling to zero along half a cosine. done: whether losses ``(B,)`` are
    small enough to stop. fused: one pass over the memory for all operations of a step, rounded otherwise; always on a
    GPU. There iterations are recorded and replayed (``graphs.repeated``), so what ``evaluate`` gives must depend on the
    phase alone, and not on a count that Python keeps.

    Examples
    --------
    >>> bowl = by_autograd(lambda phase: (phase - 1).square().mean((1, 2)))
    >>> adam(torch.zeros(1, 2, 2), bowl, iterations=60, step=0.1, decay=True).mean().round(decimals=2)
    tensor(1.)
    """
    phase, best = start.detach().clone(), Best(start)
    recorded = is_recorded(start.device)
    rate = start.new_full((), step, dtype=torch.float32) if recorded else step  # a recorded number would stay as it is
    optimiser = torch.optim.Adam([phase], lr=rate, fused=fused or recorded, capturable=recorded)

    def iterate() -> Tensor:
        loss, phase.grad = evaluate(phase)
        best.update(loss, phase)
        optimiser.step()
        return loss

    repeat = repeated(iterate, start.device)
    for iteration in range(iterations):
        if decay:
            now = cosine_decay(step, iteration / iterations)
            optimiser.param_groups[0]["lr"] = rate.fill_(now) if isinstance(rate, Tensor) else now
        if done(repeat()):
            break
    return best.phase


def by_autograd(loss: Callable[[Tensor], Tensor]) -> Evaluate:
    """Evaluate a loss of a phase, ``(B, H, W)`` to ``(B,)``, with autograd in the place of a written-out gradient."""

    def evaluate(phase: Tensor) -> tuple[Tensor, Tensor]:
        phase = phase.detach().requires_grad_()
        losses = loss(phase)
        (gradient,) = torch.autograd.grad(phase.shape[-2] * phase.shape[-1] * losses.sum(), phase)
        return losses.detach(), gradient

    return evaluate


def cosine_decay(step: float, progress: float) -> float:
    """A step that falls from ``step`` to zero along half a cosine, of which the share ``progress`` is done.

    Examples
    --------
    >>> [round(cosine_decay(0.1, progress), 3) for progress in (0, 0.5, 1)]
    [0.1, 0.05, 0.0]
    """
    return step * (1 + math.cos(math.pi * progress)) / 2
