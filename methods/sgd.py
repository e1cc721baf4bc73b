"""Stochastic-gradient phase retrieval of Neural Holography: descent on the squared error of amplitude.

Peng, Choi, Padmanaban & Wetzstein, "Neural holography with camera-in-the-loop training", ACM Trans. Graph. 39(6),
185 (2020).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

from annotated_types import Interval
from torch import Tensor

from .common import Bench, ByColour, Offset, nominal_model, with_offset
from .descent import adam
from .initial_phase import InitialPhase, initial_phase
from .losses import amplitude_l2
from .wirtinger import Objective


@dataclass(frozen=True)
class AmplitudeSGD(ByColour):
    """Adam on the phase for the squared error of amplitude in the region; light outside it is free.

    One departure from the paper: the scale between the amplitudes is the closed-form optimum of each iteration,
    where the paper learns it by a gradient step of its own. SI units throughout.

    Parameters
    ----------
    iterations : int
        Evaluations of loss and gradient.
    step : float
        Adam's step [rad], constant as published.
    initial_phase : str
        Where the descent starts. random: uniform over 2 pi; narrow: uniform over 1 rad; constant: zero; quadratic: the
        lens that gathers the light of the panel in the region; dpe: the double phase hologram.
    offset : {"none", "centre"}
        Constant phase that is added in the end. none: zero; centre: the one that brings the phase of the fewest pixels
        to the wrap between 0 and 2 pi, whose edges a panel blurs.
    """

    iterations: Annotated[int, Interval(ge=1, le=100_000)] = 200
    step: Annotated[float, Interval(gt=0, le=10)] = 0.1
    initial_phase: InitialPhase = "narrow"
    offset: Offset = "centre"

    title: ClassVar[str] = "gradient descent on amplitude"

    def retrieve(self, target: Tensor, bench: Bench, channel: int) -> Tensor:
        """The phase of the least loss that was seen (Peng et al. 2020)."""
        objective = Objective(nominal_model(bench, channel, target), bench.spec.region, target, amplitude_l2)
        start = initial_phase(self.initial_phase, target, bench, channel)
        return with_offset(adam(start, objective.evaluate, self.iterations, self.step), self.offset)
