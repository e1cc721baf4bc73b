"""Descent on levels through a relaxation that hardens as it goes.

Choi, Gopakumar, Peng, Kim, O'Toole & Wetzstein, "Time-multiplexed neural holography: a flexible framework for
holographic near-eye displays with fast heavily-quantized spatial light modulators", ACM SIGGRAPH (2022), Section 4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor

from ...optics.phase import TAU
from ..common import Bench, ByColour, nominal_model, unit_field
from ..descent import Adam, by_autograd
from ..initial_phase import InitialPhase, initial_phase
from ..losses import intensity_l2
from .levels import Levels

LEAST = 1e-9  # of a uniform random number: its double logarithm is finite


@dataclass(frozen=True)
class Gumbel(ByColour):
    """Adam on a phase that gives each pixel a soft choice among the panel's levels (Gumbel-softmax).

    A level's score falls with its distance from the phase; a softmax of score and Gumbel noise over a temperature
    weighs the levels' light. The temperature falls from iteration to iteration, until one level is left. Departures
    from the paper: what is weighed is the levels' light, not their phases, whose mean has no meaning around the circle;
    the loss is of intensity; and the start is smooth. It is not the authors' code: scores agree on `plm-4bit`, and
    differ by 7 dB and more on two levels. Time and memory grow with the number of levels. SI units throughout.

    Several frames are found together: the loss is that of their mean intensity, and they share one exposure. Each frame
    has noise of its own.

    Parameters
    ----------
    frames : int
        Frames of a hologram.
    iterations : int
        Evaluations of loss and gradient.
    step : float
        Adam's step [rad].
    sharpness : float
        Of the score ``sharpness 4 s (1 - s)``, s the logistic function of ``width`` times the distance over pi.
    width : float
        How fast the score falls with that distance.
    hottest, coldest : float
        Temperatures of the first and the last iteration; in between they fall by equal factors.
    initial_phase : str
        Where the descent starts. random: uniform over 2 pi; narrow: uniform over 1 rad; constant: zero; quadratic: the
        lens that gathers the light of the panel in the region; dpe: the double phase hologram.
    """

    frames: Annotated[int, Interval(ge=1, le=256)] = 1
    iterations: Annotated[int, Interval(ge=1, le=100_000)] = 300
    step: Annotated[float, Interval(gt=0, le=10)] = 0.1
    sharpness: Annotated[float, Interval(gt=0, le=1e4)] = 30.0
    width: Annotated[float, Interval(gt=0, le=1e3)] = 5.0
    hottest: Annotated[float, Interval(gt=0, le=100)] = 10.0
    coldest: Annotated[float, Interval(gt=0, le=100)] = 1.0
    initial_phase: InitialPhase = "constant"

    title: ClassVar[str] = "annealed descent on levels, after Choi 2022"
    tuned: ClassVar[str] = "score, temperatures and step: on an ideal panel of two levels, with two photographs"

    def retrieve(self, target: Tensor, bench: Bench, channel: int) -> Tensor:
        """Phases that show the levels which the relaxation ends in."""
        model, region = nominal_model(bench, channel, target), bench.spec.region
        levels, draw = Levels(bench.spec, channel, target), bench.generator("gumbel", channel)
        start = initial_phase(self.initial_phase, target, bench, channel)
        phase = start.repeat_interleave(self.frames, dim=0)  # (B F, H, W)
        optimiser = Adam(phase, self.step)
        for iteration in range(self.iterations):
            temperature = self.hottest * (self.coldest / self.hottest) ** (iteration / self.iterations)
            noise = gumbel_noise((self.frames, len(levels.phases), *phase.shape[-2:]), draw).to(phase)
            noise = noise.repeat(len(target), 1, 1, 1)

            def loss(phase: Tensor, temperature: float = temperature, noise: Tensor = noise) -> Tensor:
                light = self._soft(phase, levels, temperature, noise)
                intensity = region.crop(model.forward(light)).abs().square()
                return intensity_l2(intensity.unflatten(0, (-1, self.frames)).mean(1), target)

            optimiser.step(by_autograd(loss)(phase)[1])
        shown = levels.shown_by(levels.nearest(phase))
        return shown if self.frames == 1 else shown.unflatten(0, (-1, self.frames))

    def _soft(self, phase: Tensor, levels: Levels, temperature: float, noise: Tensor) -> Tensor:
        """The light ``(B, H, W)`` of soft choices at a phase ``(B, H, W)``; noise ``(B, L, H, W)``."""
        shown = levels.light(torch.arange(len(levels.phases), device=phase.device)[:, None, None])
        apart = torch.remainder(phase[:, None] - shown + math.pi, TAU) - math.pi
        nearness = torch.sigmoid(apart * (self.width / math.pi))
        score = self.sharpness * 4 * nearness * (1 - nearness)
        share = torch.softmax((score + noise) / temperature, dim=1)
        return (share * unit_field(shown)).sum(1)


def gumbel_noise(shape: tuple[int, ...], draw: torch.Generator) -> Tensor:
    """Random numbers of Gumbel's distribution: the largest of many exponential ones, less its mean's logarithm."""
    return -torch.log(-torch.log(torch.rand(shape, generator=draw).clamp(LEAST, 1 - 1e-7)))
