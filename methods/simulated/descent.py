"""Descent on the expected score of what a simulated bench shows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated

import torch
from annotated_types import Interval
from torch import Tensor

from ...display.api import Simulation
from ..common import TINY
from ..descent import Best, adam, by_autograd


@dataclass(frozen=True)
class BenchDescent:
    """Adam on the phase for the expected score, differentiated through every stage of a simulated bench.

    A descent is made of rounds, each from the best phase so far with the step falling to zero along half a cosine: on
    ``leto-aged`` at 256 px, eight rounds of 20 iterations reached 31.1 dB, four of 40 31.2 dB, and two of 80 30.8 dB.
    Its start is few iterations of Wirtinger on purpose, since a converged nominal phase is full of wraps, and where a
    panel blurs its wraps, descent does not get out of them again.

    Parameters
    ----------
    iterations : int
        Of a round: evaluations of the expected squared error and of its gradient.
    step : float
        Adam's first step of a round [rad].
    start_iterations : int
        Of Wirtinger holography.
    tolerance : float
        A descent has converged when a round has lowered the squared error of no colour by as much [dB].
    rounds : int
        At most so many.
    """

    iterations: Annotated[int, Interval(ge=1, le=100_000)] = 20
    step: Annotated[float, Interval(gt=0, le=10)] = 0.06
    start_iterations: Annotated[int, Interval(ge=1, le=100_000)] = 5
    tolerance: Annotated[float, Interval(gt=0, le=10)] = 0.3
    rounds: Annotated[int, Interval(ge=1, le=1000)] = 10

    def best(self, bench: Simulation, target: Tensor, own: Tensor, others: Sequence[Tensor] = ()) -> Tensor:
        """The phase ``(C, H, W)`` [rad] of the best expected score, per colour: the colours do not interact.

        target: linear intensity ``(C, h, w)`` in [0, 1]; own: the start; others: phases of other methods, from the best
        of which there is a second descent.
        """
        best = Best(own)
        for phase in others:
            best.update(expected_error(phase, bench, target), phase)
        for start in (own, best.phase.clone()) if others else (own,):
            phase = self._descend(start, bench, target)
            best.update(expected_error(phase, bench, target), phase)
        return best.phase

    def _descend(self, phase: Tensor, bench: Simulation, target: Tensor) -> Tensor:
        """Rounds at the mean phase gain alone, for half the time, until the error falls no further."""
        error = partial(squared_error, bench=bench, target=target)
        before = error(phase).detach()
        for _ in range(self.rounds):
            phase = adam(phase, by_autograd(error), self.iterations, self.step, decay=True)
            after = error(phase).detach()
            if bool((after > before * 10 ** (-self.tolerance / 10)).all()):
                break
            before = after
        return phase


@torch.no_grad()
def expected_error(phase: Tensor, bench: Simulation, target: Tensor) -> Tensor:
    """`squared_error` as flicker has it in the mean."""
    return torch.stack([squared_error(phase, bench, target, gain) for gain in bench.gains]).mean(0)


def squared_error(phase: Tensor, bench: Simulation, target: Tensor, gain: float = 1.0) -> Tensor:
    """Expected mean squared error ``(C,)`` of the scored capture of a phase ``(C, H, W)`` [rad], differentiable.

    A capture is matched by least squares and clipped (``metrics.match``). With the mean I of a pixel and its variance
    v, the factor is s = sum(I T) / sum(I^2 + v); noise adds s^2 v where the clipped picture follows it, which for a
    pixel m = s I from 0 or 1 is the share of a normal distribution that lies between.
    """
    mean, variance = bench.expected(phase, target, gain)
    power = (mean.square() + variance).sum((-2, -1)).clamp_min(TINY)
    scale = ((mean * target).sum((-2, -1)).clamp_min(0) / power)[:, None, None]
    matched, noise = scale * mean, scale.square() * variance
    with torch.no_grad():
        width = (2 * noise).sqrt().clamp_min(math.sqrt(TINY))
        share = (torch.erf(matched / width) + torch.erf((1 - matched) / width)) / 2
    return ((matched.clamp(0, 1) - target).square() + share * noise).mean((-2, -1))
