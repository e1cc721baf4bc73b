"""Calibrate a model of the display from captures, hold it, and retrieve every hologram through it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor

from ...display.api import DisplaySpec
from ...display.metered import MeteredDisplay
from ...display.training import TrainingBench, TrainingImage
from ..learned.algorithm import train
from ..learned.fallback import WIRTINGER, fell_back
from ..learned.method import frozen, hologram, predicted
from ..learned.retrieval import SquaredErrorRetrieval, left_out, lpips_weights, retrieve
from ..learned.samples import Sample, Schedule, Steps
from ..wirtinger import Wirtinger
from .approximator import ModelApproximator
from .patterns import dark_samples, pattern_samples


@dataclass(frozen=True)
class LargeSteps(SquaredErrorRetrieval):
    """On held-out dead leaves of 128 px, 100 steps of 0.1 rad gained 0.7 dB over steps of 0.05 rad."""

    iterations: Annotated[int, Interval(ge=0, le=100_000)] = 100
    step: Annotated[float, Interval(gt=0, le=10)] = 0.1


@dataclass(frozen=True)
class SearchRetrieval(LargeSteps):
    """Retrieval while training: its captures need to be near the final ones only."""

    iterations: Annotated[int, Interval(ge=0, le=100_000)] = 40


@dataclass(frozen=True)
class ThroughModel(ABC):
    """Algorithm 1 of Chakravarthula et al. 2020 around a model of the display that a subclass gives; SI units.

    Parameters
    ----------
    training : Schedule
        How the display is learned: Algorithm 1.
    retrieval : LargeSteps
        Of every hologram, through what was learned: Eq. 22, of which by default the squared error alone is used.
    search : SearchRetrieval
        The same while the display is learned, in the rounds after the first.
    start : Wirtinger
        Wirtinger holography, stopped while its phase is still smooth: a converged phase is full of wraps that descent
        does not get out of.
    seed : int
        Of the model's first weights, where it has any.
    fallback : bool
        Solve by plain Wirtinger holography where the loop made the captures of held-out images worse.
    """

    training: Schedule = Schedule()
    retrieval: LargeSteps = LargeSteps()
    search: SearchRetrieval = SearchRetrieval()
    start: Wirtinger = Wirtinger(iterations=5)
    seed: int = 0
    fallback: bool = False

    trains: ClassVar[bool] = True
    fresnel: ClassVar[bool] = True
    version: ClassVar[int] = 3

    def external(self) -> dict[str, Path | None]:
        """Files that it takes where a machine has them, by what they hold; None for one that is not there."""
        return lpips_weights(self.retrieval, self.search)

    @abstractmethod
    def approximator(self, spec: DisplaySpec) -> ModelApproximator:
        """The model, untrained."""

    def prepare(self, bench: TrainingBench) -> Mapping[str, Any]:
        """Learn the display from captures.

        Parameters
        ----------
        bench : TrainingBench
            The display, the training images, and a memory that survives a kill.

        Returns
        -------
        mapping
            What `solve` and `predict` need: the parameters of the model, and whether Wirtinger holography was better;
            ``left_out``, what of the retrieval's loss the region is too small for.

        Raises
        ------
        BudgetError
            When no capture is left.
        """
        approximator = self.approximator(bench.spec).to(bench.device)
        start, search = partial(hologram, self.start, bench=bench), partial(retrieve, settings=self.search)
        dark = dark_samples(bench) if approximator.terms else []
        train(bench, approximator, start, search, self.training, [*self._earlier(bench), *dark])

        def solve(image: TrainingImage) -> Tensor:
            return retrieve(approximator.image(bench.light(image)), image.target, start(image), self.retrieval)

        lacks = left_out(bench.spec.region.shape, self.retrieval)
        return {**approximator.learned(), "fell_back": fell_back(self.fallback, bench, solve), "left_out": lacks}

    def _earlier(self, bench: TrainingBench) -> Sequence[Sample]:
        """Samples that every round learns from, beside its own and, of a model with terms, those of dark patterns."""
        return ()

    def solve(self, target: Tensor, bench: MeteredDisplay) -> Tensor:
        """Phases of least squared error in the captures that the model predicts.

        Parameters
        ----------
        target : Tensor
            Linear intensity ``(B, C, h, w)`` in [0, 1].
        bench : MeteredDisplay
            Nominal optics in SI units, and what `prepare` returned.

        Returns
        -------
        Tensor
            Phase ``(B, C, H, W)`` [rad].

        Raises
        ------
        CellError
            Where the method was not trained.
        UserError
            Where what was learned belongs to another model.
        """
        if bench.learned["fell_back"]:
            return bench.solved(WIRTINGER, target)
        display = frozen(self.approximator(bench.spec), bench).image(bench.light)
        start = bench.solved(self.start, target)
        pairs = zip(target, start, strict=True)
        return torch.stack([retrieve(display, image, phase, self.retrieval) for image, phase in pairs])

    def predict(self, phase: Tensor, bench: MeteredDisplay) -> Tensor:
        """Phase ``(B, C, H, W)`` [rad] to the capture ``(B, C, h, w)`` that was learned to follow."""
        return predicted(frozen(self.approximator(bench.spec), bench).image(bench.light), phase)


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
