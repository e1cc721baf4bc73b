"""Calibrate a model of the display from captures, hold it, and retrieve every hologram through it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor

from ..hil.loop import Rounds, Sample, Steps, captured, matched_psnr, train_in_the_loop
from ..hil.retrieval import Image, SquaredErrorRetrieval, check_region, retrieve
from ..wirtinger import Wirtinger
from .patterns import pattern_samples

if TYPE_CHECKING:
    from ...display.api import DisplaySpec
    from ...display.metered import MeteredDisplay
    from ...display.training import TrainingBench, TrainingImage
    from .approximator import ModelApproximator


@dataclass(frozen=True)
class LargeSteps(SquaredErrorRetrieval):
    """On held-out dead leaves of 128 px, 100 steps of 0.1 rad gained 0.7 dB over steps of 0.05 rad."""

    iterations: Annotated[int, Interval(ge=0, le=100_000)] = 100
    step: Annotated[float, Interval(gt=0, le=10)] = 0.1


@dataclass(frozen=True)
class Search(LargeSteps):
    """Retrieval while training: its captures need to be near the final ones only."""

    iterations: Annotated[int, Interval(ge=0, le=100_000)] = 40


@dataclass(frozen=True)
class ThroughModel(ABC):
    """Algorithm 1 of Chakravarthula et al. 2020 around a model of the display that a subclass gives.

    training: the rounds. retrieval: Eq. 22, of which the squared error alone is used. search: retrieval in the rounds.
    start: Wirtinger holography, stopped while its phase is still smooth: a converged phase is full of wraps that
    descent does not get out of.
    seed: of the model's first weights, where it has any.

    In the end, the holograms of the held-out images by ``retrieval`` through the model and by ``NOMINAL`` are captured.
    Where the latter's captures are closer to the targets, ``nominal`` is kept as 1 and ``solve`` gives them: of a
    display that is as the nominal model says, a calibration learns noise.
    """

    training: Rounds = Rounds()
    retrieval: LargeSteps = LargeSteps()
    search: Search = Search()
    start: Wirtinger = Wirtinger(iterations=5)
    seed: int = 0

    camera: ClassVar[bool] = False
    privileged: ClassVar[bool] = False
    trains: ClassVar[bool] = True
    version: ClassVar[int] = 1

    NOMINAL: ClassVar[Wirtinger] = Wirtinger()

    @abstractmethod
    def approximator(self, spec: DisplaySpec) -> ModelApproximator:
        """The model, untrained."""

    def prepare(self, bench: TrainingBench) -> Mapping[str, Any]:
        """Learn the display from captures; what ``solve`` and ``predict`` need of it."""
        approximator = self._learned(bench)
        return {**approximator.learned(), "nominal": int(self._is_nominal(bench, approximator))}

    def _before(self, _: TrainingBench) -> Sequence[Sample]:
        """Samples that every round learns from, beside its own."""
        return ()

    def _learned(self, bench: TrainingBench) -> ModelApproximator:
        """The trained model."""
        check_region(bench.spec.region.shape, self.retrieval)
        approximator = self.approximator(bench.spec).to(bench.device)

        def begin(image: TrainingImage) -> Tensor:
            return self.start.solve(image.target[None], bench)[0]

        def search(display: Image, target: Tensor, phase: Tensor) -> Tensor:
            return retrieve(display, target, phase, self.search)

        train_in_the_loop(bench, approximator, begin, search, self.training, self._before(bench))
        return approximator

    def _is_nominal(self, bench: TrainingBench, approximator: ModelApproximator) -> bool:
        """Whether, on the held-out images, plain Wirtinger holography is captured closer to the targets."""

        def learned(image: TrainingImage) -> Tensor:
            start = self.start.solve(image.target[None], bench)[0]
            return retrieve(approximator.image(bench.light(image)), image.target, start, self.retrieval)

        def nominal(image: TrainingImage) -> Tensor:
            return self.NOMINAL.solve(image.target[None], bench)[0]

        def quality(name: str, solve: Callable[[TrainingImage], Tensor]) -> list[float]:
            """PSNR [dB] of every held-out image."""
            phases = [solve(image) for image in bench.held_out]
            pairs = list(zip(phases, bench.held_out, strict=True))
            bench.announce((phase, image, (name,)) for phase, image in pairs)
            shown = [
                bench.kept(f"{name} {image.item}", partial(captured, bench, phase, image, name))["capture"]
                for phase, image in pairs
            ]
            return [matched_psnr(one, image.target) for one, image in zip(shown, bench.held_out, strict=True)]

        pairs = zip(quality("learned", learned), quality("nominal", nominal), strict=True)
        gains = [ours - plain for ours, plain in pairs]
        return sum(gains) < 0

    def solve(self, target: Tensor, bench: MeteredDisplay) -> Tensor:
        """Linear intensity ``(B, C, h, w)`` to phase ``(B, C, H, W)`` [rad]."""
        if bench.learned["nominal"]:
            return self.NOMINAL.solve(target, bench)
        display, start = self._display(bench), self.start.solve(target, bench)
        pairs = zip(target, start, strict=True)
        return torch.stack([retrieve(display, image, phase, self.retrieval) for image, phase in pairs])

    @torch.no_grad()
    def predict(self, phase: Tensor, bench: MeteredDisplay) -> Tensor:
        """Phase ``(B, C, H, W)`` [rad] to the capture ``(B, C, h, w)`` that was learned to follow."""
        display = self._display(bench)
        return torch.stack([display(one) for one in phase])

    def _display(self, bench: MeteredDisplay) -> Image:
        approximator = self.approximator(bench.spec).to(bench.device)
        approximator.load_learned(bench.learned)
        return approximator.image(bench.light)


@dataclass(frozen=True)
class Schedule(Rounds):
    """Few captures and few steps: the first round on natural holograms, later ones on those that the model made."""

    rounds: Annotated[int, Interval(ge=1, le=100)] = 2
    images: Annotated[int, Interval(ge=1)] | None = 12
    refine_images: Annotated[int, Interval(ge=1)] | None = 12
    steps: Steps = 300
    refine_steps: Steps = 200


@dataclass(frozen=True)
class Calibrated(ThroughModel):
    """``ThroughModel`` from few captures. patterns: speckle-like, captured before and learned from in all rounds."""

    training: Schedule = Schedule()
    patterns: Annotated[int, Interval(ge=0, le=1000)] = 12

    def _before(self, bench: TrainingBench) -> Sequence[Sample]:
        return pattern_samples(bench, self.patterns)
