"""Learn the display from captures, hold what was learned, and retrieve every hologram through it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, Generic, TypeVar

import torch
from torch import Tensor

from ...display.api import DisplaySpec
from ...display.metered import MeteredDisplay
from ...display.training import TrainingBench, TrainingImage
from ..wirtinger import Wirtinger
from .algorithm import train
from .fallback import WIRTINGER, fell_back
from .retrieval import Image, PhaseRetrieval, left_out
from .samples import Approximator, Sample, Schedule

A = TypeVar("A", bound=Approximator)


@dataclass(frozen=True)
class LearnedLoop(ABC, Generic[A]):
    """Algorithm 1 of Chakravarthula et al. 2020 around an approximator that a subclass gives; SI units.

    Parameters
    ----------
    training : Schedule
        How the display is learned: Algorithm 1.
    retrieval : PhaseRetrieval
        Of every hologram, through what was learned: Eq. 22.
    start : Wirtinger
        Wirtinger holography, where Algorithm 1 and every retrieval begin.
    seed : int
        Of the approximator's first weights, besides the study's.
    fallback : bool
        Not in the paper: solve by plain Wirtinger holography where the loop made the captures of held-out images worse.
    """

    training: Schedule = Schedule()
    retrieval: PhaseRetrieval = PhaseRetrieval()
    start: Wirtinger = Wirtinger()
    seed: int = 0
    fallback: bool = False

    trains: ClassVar[bool] = True

    @abstractmethod
    def approximator(self, spec: DisplaySpec) -> A:
        """D, untrained."""

    def prepare(self, bench: TrainingBench) -> Mapping[str, Any]:
        """Train the approximator on captures of the display (Algorithm 1).

        Parameters
        ----------
        bench : TrainingBench
            The display, the training images, and a memory that survives a kill.

        Returns
        -------
        mapping
            What `solve` and `predict` need: the weights of D, and whether Wirtinger holography was better;
            ``left_out``, the terms of the retrieval's loss that the region is too small for.

        Raises
        ------
        BudgetError
            When no capture is left.
        """
        approximator = self.approximator(bench.spec)
        approximator.to(bench.device)
        start, samples = partial(bench.solved, self.start), self._samples(approximator, bench)
        train(bench, approximator, start, partial(self._search, approximator), self.training, samples)

        def solve(image: TrainingImage) -> Tensor:
            return self._retrieve(approximator, approximator.image(bench.light(image)), image.target, start(image))

        lacks = left_out(bench.spec.region.shape, self.retrieval)
        return {**approximator.learned(), "fell_back": fell_back(self.fallback, bench, solve), "left_out": lacks}

    def solve(self, target: Tensor, bench: MeteredDisplay) -> Tensor:
        """Phases ``(B, C, H, W)`` [rad] of least loss (Eq. 22) in the captures that the approximator predicts.

        target: linear intensity ``(B, C, h, w)`` in [0, 1]. CellError: it was not trained; UserError: what was learned
        belongs to another approximator.
        """
        if bench.learned["fell_back"]:
            return bench.solved(WIRTINGER, target)
        approximator = self._learned(bench)
        display, start = approximator.image(bench.light), bench.solved(self.start, target)
        pairs = zip(target, start, strict=True)
        return torch.stack([self._retrieve(approximator, display, *pair) for pair in pairs])

    def predict(self, phase: Tensor, bench: MeteredDisplay) -> Tensor:
        """Phase ``(B, C, H, W)`` [rad] to the capture ``(B, C, h, w)``, linear light, that was learned to follow."""
        display = self._learned(bench).image(bench.light)
        with torch.no_grad():
            return torch.stack([display(panel) for panel in phase])

    def _learned(self, bench: MeteredDisplay) -> A:
        """D with what was learned; UserError where that is another network's."""
        approximator = self.approximator(bench.spec)
        approximator.to(bench.device)
        approximator.load_learned(bench.learned)
        return approximator

    def _samples(self, approximator: A, bench: TrainingBench) -> Sequence[Sample]:
        """Captures that every round learns from, beside its own."""
        return ()

    @abstractmethod
    def _retrieve(self, approximator: A, display: Image, target: Tensor, start: Tensor) -> Tensor:
        """The hologram ``(C, H, W)`` [rad] of a target ``(C, h, w)`` near a start."""

    def _search(self, approximator: A, display: Image, target: Tensor, start: Tensor) -> Tensor:
        """The same while the display is learned, in the rounds after the first."""
        return self._retrieve(approximator, display, target, start)
