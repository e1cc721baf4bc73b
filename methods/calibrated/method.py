"""Calibrate a model of the display from captures, hold it, and retrieve every hologram through it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, ClassVar

from annotated_types import Interval
from torch import Tensor

from ...display.training import TrainingBench
from ..learned.loop import LearnedLoop
from ..learned.retrieval import Image, SquaredErrorRetrieval, lpips_weights, retrieve
from ..learned.samples import Sample, Schedule, Steps, together
from ..wirtinger import Wirtinger
from .approximator import ModelApproximator
from .patterns import dark_samples, pattern_samples


@dataclass(frozen=True)
class LargeSteps(SquaredErrorRetrieval):
    """On held-out dead leaves of 128 px, 100 steps of 0.1 rad gained 0.7 dB over steps of 0.05 rad; on ten crops for
    256 px they lost 2.0 dB against steps of 0.03 rad (`hil_plus` on `leto-2020`)."""

    iterations: Annotated[int, Interval(ge=0, le=100_000)] = 100
    step: Annotated[float, Interval(gt=0, le=10)] = 0.1


@dataclass(frozen=True)
class SearchRetrieval(LargeSteps):
    """Retrieval while training: its captures need to be near the final ones only."""

    iterations: Annotated[int, Interval(ge=0, le=100_000)] = 40


@dataclass(frozen=True)
class ThroughModel(LearnedLoop[ModelApproximator]):
    """Algorithm 1 of Chakravarthula et al. 2020 around a model of the display that a subclass gives; SI units.

    Parameters
    ----------
    retrieval : LargeSteps
        Of every hologram, through what was learned: Eq. 22, of which by default the squared error alone is used.
    search : SearchRetrieval
        The same while the display is learned, in the rounds after the first.
    start : Wirtinger
        Wirtinger holography, stopped while its phase is still smooth: a converged phase is full of wraps that descent
        does not get out of.
    """

    retrieval: LargeSteps = LargeSteps()
    search: SearchRetrieval = SearchRetrieval()
    start: Wirtinger = Wirtinger(iterations=5)

    fresnel: ClassVar[bool] = True
    version: ClassVar[int] = 3

    def external(self) -> dict[str, Path | None]:
        """Files that it takes where a machine has them, by what they hold; None for one that is not there."""
        return lpips_weights(self.retrieval, self.search)

    def _samples(self, approximator: ModelApproximator, bench: TrainingBench) -> Sequence[Sample]:
        dark = [partial(dark_samples, bench)] if approximator.terms else []
        return together(partial(self._earlier, bench), *dark)

    def _earlier(self, bench: TrainingBench) -> Sequence[Sample]:
        """Samples that every round learns from, beside its own and, of a model with terms, those of dark patterns."""
        return ()

    def _retrieve(self, approximator: ModelApproximator, display: Image, target: Tensor, start: Tensor) -> Tensor:
        return retrieve(display, target, start, self.retrieval)

    def _search(self, approximator: ModelApproximator, display: Image, target: Tensor, start: Tensor) -> Tensor:
        return retrieve(display, target, start, self.search)


@dataclass(frozen=True)
class ShortSchedule(Schedule):
    """Few captures and few steps: the first round on natural holograms, later ones on those that the model made."""

    rounds: Annotated[int, Interval(ge=1, le=100)] = 2
    images: Annotated[int, Interval(ge=1)] | None = 12
    refine_images: Annotated[int, Interval(ge=1)] | None = 12
    steps: Steps = 300
    refine_steps: Steps = 200


@dataclass(frozen=True)
class Calibrated(ThroughModel):
    """`ThroughModel` from few captures.

    Parameters
    ----------
    patterns : int
        Speckle-like patterns, captured before and learned from in all rounds.
    """

    training: ShortSchedule = ShortSchedule()
    patterns: Annotated[int, Interval(ge=0, le=1000)] = 12

    def _earlier(self, bench: TrainingBench) -> Sequence[Sample]:
        return pattern_samples(bench, self.patterns)
