"""Algorithm 1: retrieve phases with the approximator held, capture them, refine the approximator; K rounds.

Chakravarthula et al. 2020, Section 4.4. Everything that took time is kept in the bench's memory as it is made, so that
a training can be killed at any moment and ends with the weights of one that was not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Protocol

import torch
from annotated_types import Interval
from torch import Tensor

from .retrieval import Image, matched

if TYPE_CHECKING:
    from ...display.training import TrainingBench, TrainingImage

Steps = Annotated[int, Interval(ge=1, le=1_000_000)]
STEPS_BETWEEN_SAVES = 100


@dataclass(frozen=True)
class Rounds:
    """How Algorithm 1 is run.

    rounds: K. images: how many of the training images are used (None: all). refine_images: of these, how many are
    retrieved and captured in each round after the first, going through them in turn (None: all, as in the paper; a
    retrieval takes far longer than the first round's start). steps: optimiser steps of the first round, which learns
    the display; refine_steps: of each later one. The paper's network sees 40000 in all. keep_captures: refine with the
    captures of all rounds so far instead of the most recent ones alone.
    """

    rounds: Annotated[int, Interval(ge=1, le=100)] = 3
    images: Annotated[int, Interval(ge=1)] | None = None
    refine_images: Annotated[int, Interval(ge=1)] | None = 4
    steps: Steps = 900
    refine_steps: Steps = 200
    keep_captures: bool = True

    def shown(self, images: Sequence[TrainingImage], number: int) -> list[TrainingImage]:
        """The images of a round."""
        used = images[: self.images]
        if number == 1 or self.refine_images is None or self.refine_images >= len(used):
            return list(used)
        first = (number - 2) * self.refine_images
        return [used[(first + index) % len(used)] for index in range(self.refine_images)]


@dataclass(frozen=True)
class Sample:
    """A hologram of a training image and its capture.

    phase: ``(C, H, W)`` [rad]; capture, target: ``(C, h, w)`` linear light; light: ``(C,)``, that of a white pixel
    which all of the panel's light went into, the unit of the capture.
    """

    phase: Tensor
    capture: Tensor
    target: Tensor
    light: Tensor


class Approximator(Protocol):
    """The differentiable stand-in for the display, D in the paper, and how it learns."""

    def expose(self, samples: Sequence[Sample]) -> None:
        """Choose, once, from the first captures, the unit in which captures are learned."""
        ...

    def step(self, sample: Sample, progress: float) -> dict[str, float]:
        """One step of training, when the share ``progress`` of the round's steps is done; the losses by name."""
        ...

    def image(self, light: Tensor) -> Image:
        """The display with the weights as they are now, held: phase to predicted capture."""
        ...

    def state_dict(self) -> dict[str, Any]:
        """All that the next step depends on."""
        ...

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go on from a state."""
        ...


Search = Callable[[Image, Tensor, Tensor], Tensor]
"""Display as it is approximated, target ``(C, h, w)``, start ``(C, H, W)``: the phase retrieved through it."""


def train_in_the_loop(
    bench: TrainingBench,
    approximator: Approximator,
    start: Callable[[TrainingImage], Tensor],
    search: Search,
    settings: Rounds,
    before: Sequence[Sample] = (),
) -> None:
    """Algorithm 1. start: the phase of an image that the first round shows (D = Id, so Wirtinger holography) and that
    every later retrieval begins with. before: samples that every round learns from, beside its own."""

    def begin(image: TrainingImage) -> Tensor:
        return bench.kept(f"start {image.item}", lambda: {"phase": start(image)})["phase"]

    def retrieve(image: TrainingImage, number: int) -> dict[str, Tensor]:
        """The phase of a round: retrieved with the approximator held, but in the first one."""
        phase = begin(image)
        return {"phase": phase if number == 1 else search(approximator.image(bench.light(image)), image.target, phase)}

    def show(images: Sequence[TrainingImage], number: int, purpose: str) -> Iterator[Sample]:
        """Retrieve a phase for every image, then capture them."""
        keys = [f"{purpose} {number} {image.item}" for image in images]
        phases = [
            bench.kept(f"phase of {key}", partial(retrieve, image, number))["phase"]
            for key, image in zip(keys, images, strict=True)
        ]
        bench.announce((phase, image, (purpose, number)) for phase, image in zip(phases, images, strict=True))
        for key, phase, image in zip(keys, phases, images, strict=True):
            capture = bench.kept(key, partial(captured, bench, phase, image, purpose, number))["capture"]
            yield Sample(phase, capture, image.target, bench.light(image))

    saved = bench.load("approximator") or {"round": 0, "step": 0}
    samples = list(before)
    for number in range(1, settings.rounds + 1):
        fresh = []
        for sample in show(settings.shown(bench.images, number), number, "round"):
            fresh.append(sample)
            if number > saved["round"]:
                bench.log(round=number, step=0, images=len(fresh))
        samples = [*(samples if settings.keep_captures else before), *fresh]
        if number == 1:
            approximator.expose(samples)
        if number == max(1, saved["round"]) and saved["round"]:
            approximator.load_state_dict(saved["state"])
        if number < saved["round"]:
            continue  # learned and watched before an interruption
        steps = range(saved["step"] if number == saved["round"] else 0, _steps(settings, number))
        refine(bench, approximator, samples, number, steps)
        seen = list(show(bench.held_out, number + 1, "held out"))
        bench.log(round=number, step=steps.stop, **fidelity(approximator, seen))


def captured(bench: TrainingBench, phase: Tensor, image: TrainingImage, *names: object) -> dict[str, Tensor]:
    """A photograph under a name to keep it by; see ``TrainingBench.photograph``."""
    return {"capture": bench.photograph(phase, image, *names)}


def refine(
    bench: TrainingBench, approximator: Approximator, samples: Sequence[Sample], number: int, steps: range
) -> None:
    """Steps of training on samples in a random order, the same however often it was interrupted."""
    draw = bench.generator("order", number)
    order = torch.cat([torch.randperm(len(samples), generator=draw) for _ in range(-(-steps.stop // len(samples)))])
    sums: dict[str, float] = {}
    for step in steps:
        losses = approximator.step(samples[int(order[step])], step / steps.stop)
        sums = {name: sums.get(name, 0.0) + value for name, value in losses.items()}
        if (step + 1) % STEPS_BETWEEN_SAVES == 0 or step + 1 == steps.stop:
            counted = (step - steps.start) % STEPS_BETWEEN_SAVES + 1
            bench.log(round=number, step=step + 1, **{name: value / counted for name, value in sums.items() if value})
            bench.save("approximator", {"round": number, "step": step + 1, "state": approximator.state_dict()})
            sums = {}


def fidelity(approximator: Approximator, samples: Sequence[Sample]) -> dict[str, float]:
    """On unseen images, PSNR [dB] of the picture that was predicted, of the one captured, and of the one against the
    other: a prediction that is better than its capture is the network being exploited."""
    rows = []
    for sample in samples:
        with torch.no_grad():
            predicted = approximator.image(sample.light)(sample.phase)
        capture = matched(sample.capture, sample.target)
        pairs = ((matched(predicted, sample.target), sample.target), (capture, sample.target))
        rows.append([_psnr(a, b) for a, b in (*pairs, (matched(predicted, capture), capture))])
    means = torch.tensor(rows).mean(0).tolist()
    return dict(zip(("predicted_psnr", "captured_psnr", "fidelity_psnr"), means, strict=True))


def matched_psnr(image: Tensor, target: Tensor) -> float:
    """PSNR [dB] of an image ``(C, h, w)`` at the brightness of its target."""
    return _psnr(matched(image, target), target)


def _psnr(image: Tensor, target: Tensor) -> float:
    error = (image.clamp(0, 1) - target.clamp(0, 1)).square().mean()
    return float(-10 * torch.log10(error.clamp_min(1e-12)))


def _steps(settings: Rounds, number: int) -> int:
    return settings.steps if number == 1 else settings.refine_steps
