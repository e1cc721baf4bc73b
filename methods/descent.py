"""What descent methods share: Adam on a phase, the best phase so far, and a decaying step."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import InitVar, dataclass, field

import torch
from torch import Tensor

from ..core.graphs import is_recorded, repeated
from ..optics.blocks import in_blocks
from . import kernels
from .rows import compilable, floats

Evaluate = Callable[[Tensor], tuple[Tensor, Tensor]]
"""Phase ``(B, H, W)`` [rad] to the loss ``(B,)`` and its gradient ``(B, H, W)``."""


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
            lines, kept = phase.shape[-2], self.phase
            in_blocks(lambda rows: kept[..., rows, :].copy_(phase[..., rows, :]), kept, lines, kept.numel())
        else:
            self.phase[better] = phase[better]
        self.loss.copy_(torch.where(better, loss, self.loss))


class Adam:
    """Adam's steps on a phase ``(..., H, W)`` [rad], in place: Kingma & Ba, ICLR 2015, with its constants.

    Its epsilon is divided by the panel's pixels, as the slopes of a mean over pixels are.
    """

    BETAS, EPSILON = (0.9, 0.999), 1e-8

    def __init__(self, phase: Tensor, rate: float) -> None:
        self._phase, self._epsilon = phase, self.EPSILON / (phase.shape[-2] * phase.shape[-1])
        self._rate, self._steps, self._in_torch = rate, 0, None
        if compilable(phase):
            self._moments = torch.zeros_like(phase), torch.zeros_like(phase)
        else:
            recorded = is_recorded(phase.device)  # a recorded number would stay as it is
            first = phase.new_full((), rate, dtype=torch.float32) if recorded else rate
            self._in_torch = torch.optim.Adam(
                [phase], first, self.BETAS, self._epsilon, fused=True, capturable=recorded
            )

    def set_rate(self, rate: float) -> None:
        """The rate [rad] from the next step on."""
        self._rate = rate
        if self._in_torch is not None:
            group = self._in_torch.param_groups[0]
            group["lr"] = group["lr"].fill_(rate) if isinstance(group["lr"], Tensor) else rate

    def step(self, gradient: Tensor) -> None:
        """One step by a gradient ``(..., H, W)``."""
        gradient = gradient.contiguous().resolve_neg()  # torch's fused step reads memory as it lies
        if self._in_torch is not None:
            self._phase.grad = gradient
            self._in_torch.step()
            return
        self._steps += 1
        first, second = (1 - beta**self._steps for beta in self.BETAS)  # the moments begin at zero
        step, epsilon = self._rate * math.sqrt(second) / first, self._epsilon * math.sqrt(second)
        rows = [floats(array.flatten(0, -2)) for array in (self._phase, gradient, *self._moments)]

        def work(some: slice) -> None:
            phase, slope, mean, square = (array[some] for array in rows)
            kernels.adam_rows(phase, slope, mean, square, self.BETAS, step, epsilon)

        in_blocks(work, gradient, len(rows[0]), gradient.numel())


def adam(
    start: Tensor,
    evaluate: Evaluate,
    iterations: int,
    step: float,
    *,
    decay: bool = False,
    done: Callable[[Tensor], bool] = lambda loss: False,
) -> Tensor:
    """The phase of the least loss that Adam sees on its way from ``start`` ``(B, H, W)`` [rad].

    step: its rate [rad], constant or (``decay``) falling to zero along half a cosine. done: whether losses ``(B,)`` are
    small enough to stop. On a GPU iterations are recorded and replayed (``graphs.repeated``), so what ``evaluate``
    gives must depend on the phase alone, and not on a count that Python keeps.

    Examples
    --------
    >>> bowl = by_autograd(lambda phase: (phase - 1).square().mean((1, 2)))
    >>> adam(torch.zeros(1, 2, 2), bowl, iterations=60, step=0.1, decay=True).mean().round(decimals=2)
    tensor(1.)
    """
    start = start.detach().contiguous()
    phase, best = start.clone(), Best(start)
    optimiser = Adam(phase, step)

    def iterate() -> Tensor:
        loss, gradient = evaluate(phase)
        best.update(loss, phase)
        optimiser.step(gradient)
        return loss

    repeat = repeated(iterate, start.device)
    for iteration in range(iterations):
        if decay:
            optimiser.set_rate(cosine_decay(step, iteration / iterations))
        if done(repeat()):
            break
    return best.phase


def by_autograd(loss: Callable[[Tensor], Tensor]) -> Evaluate:
    """Evaluate a loss of a phase, ``(B, H, W)`` to ``(B,)``, with autograd in the place of a written-out gradient."""

    def evaluate(phase: Tensor) -> tuple[Tensor, Tensor]:
        phase = phase.detach().requires_grad_()
        losses = loss(phase)
        (gradient,) = torch.autograd.grad(losses.sum(), phase)
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
