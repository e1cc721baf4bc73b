"""The terms of Algorithm 1: its schedule, a captured hologram, and what an approximator has to offer."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, Protocol

import torch
from annotated_types import Interval
from torch import Tensor

from ...core.errors import Pending
from ...display.training import TrainingBench, TrainingImage
from .retrieval import Image

Steps = Annotated[int, Interval(ge=1, le=1_000_000)]


@dataclass(frozen=True)
class Schedule:
    """How Algorithm 1 of Chakravarthula et al. 2020 is run.

    Parameters
    ----------
    rounds : int
        How many times captures are taken and learned from: K of Algorithm 1.
    images : int, optional
        How many of the training images are used; null: all.
    refine_images : int, optional
        Not in the paper: how many of these are retrieved and captured in each round after the first, in turn. A
        retrieval takes far longer than the first round's start. Null: all, as in the paper.
    steps : int
        Optimiser steps of the first round, which learns the display. The paper's network sees 40000 in all.
    refine_steps : int
        Optimiser steps of each later round.
    keep_captures : bool
        Refine with the captures of all rounds so far; else with the most recent ones alone, as in the paper.
    """

    rounds: Annotated[int, Interval(ge=1, le=100)] = 3
    images: Annotated[int, Interval(ge=1)] | None = None
    refine_images: Annotated[int, Interval(ge=1)] | None = 4
    steps: Steps = 900
    refine_steps: Steps = 200
    keep_captures: bool = True

    def images_of(self, number: int, images: Sequence[TrainingImage]) -> list[TrainingImage]:
        """The images of a round.

        Examples
        --------
        >>> [Schedule(refine_images=2).images_of(number, "abc") for number in (1, 2, 3)]
        [['a', 'b', 'c'], ['a', 'b'], ['c', 'a']]
        """
        used = images[: self.images]
        if number == 1 or self.refine_images is None or self.refine_images >= len(used):
            return list(used)
        first = (number - 2) * self.refine_images
        return [used[(first + index) % len(used)] for index in range(self.refine_images)]

    def steps_of(self, number: int) -> int:
        """The steps of a round."""
        return self.steps if number == 1 else self.refine_steps

    def ends(self, watched: Sequence[float]) -> bool:
        """Whether the rounds so far are enough, by how well each predicted captures of held-out images [dB]."""
        return False


@dataclass(frozen=True)
class Sample:
    """A hologram of a training image and its capture.

    Parameters
    ----------
    phase : Tensor
        ``(C, H, W)`` [rad].
    capture, target : Tensor
        ``(C, h, w)``, linear light.
    light : Tensor
        ``(C,)``, that of a white pixel which all of the panel's light went into, the unit of the capture.
    number : int
        Of the capture, in the order in which those of a training were taken; 0 where it is not known.
    """

    phase: Tensor
    capture: Tensor
    target: Tensor
    light: Tensor
    number: int = 0


class Approximator(Protocol):
    """The differentiable stand-in for the display, D in the paper, and how it learns."""

    def to(self, device: torch.device) -> Approximator:
        """Itself, before the first step, on a device."""

    def expose(self, samples: Sequence[Sample]) -> None:
        """Choose, once, from the first captures, the unit in which captures are learned."""

    def step(self, sample: Sample, progress: float) -> dict[str, float]:
        """One step of training, when the share ``progress`` of the round's steps is done; the losses by name."""

    def image(self, light: Tensor) -> Image:
        """The display with the weights as they are now, held: phase to predicted capture."""

    def predicted(self, sample: Sample) -> Tensor:
        """What it expects of the capture of a sample, ``(C, h, w)``."""
        return self.image(sample.light)(sample.phase)

    def state_dict(self) -> dict[str, Any]:
        """All that the next step depends on."""

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go on from a state."""

    def learned(self) -> dict[str, Any]:
        """What phase retrieval needs."""

    def load_learned(self, weights: Mapping[str, Any]) -> None:
        """Take over what was learned; UserError for the weights of another network."""


def captured(
    bench: TrainingBench, keys: Sequence[str], phases: Sequence[Tensor], images: Sequence[TrainingImage], *names: object
) -> Iterator[Sample]:
    """Captures of phases, announced together and each kept under its key; ``names`` decide on their noise."""
    bench.announce((phase, image, names) for phase, image in zip(phases, images, strict=True))
    for key, phase, image in zip(keys, phases, images, strict=True):
        kept = bench.kept(key, partial(_photograph, bench, phase, image, *names))
        yield Sample(phase, kept["capture"], image.target, bench.light(image), kept.get("number", 0))


def together(*kinds: Callable[[], Sequence[Sample]]) -> list[Sample]:
    """Samples of several kinds. Those of all kinds are announced before one that waits for a photograph says so, so
    that people who exchange files with a bench take them in one round."""
    found, waits = list[Sample](), list[Pending]()
    for kind in kinds:
        try:
            found += kind()
        except Pending as pending:
            waits.append(pending)
    if waits:
        raise waits[0]
    return found


def _photograph(bench: TrainingBench, phase: Tensor, image: TrainingImage, *names: object) -> dict[str, Any]:
    return {"capture": bench.photograph(phase, image, *names), "number": bench.number}
