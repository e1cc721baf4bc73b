"""What a killed training goes on from. Not in the paper."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial

import torch
from torch import Tensor

from ...display.training import TrainingBench, TrainingImage
from .samples import Approximator, Sample, Schedule, captured

STEPS_BETWEEN_SAVES = 100


class Checkpoint:
    """Repeats what a training has done so far out of the bench's memory, and keeps and logs what is new.

    All that takes time is kept as it is made: starts, phases, captures, and the approximator every
    ``STEPS_BETWEEN_SAVES`` steps. A training that is killed at any moment and started again so ends with the same bits,
    and the same rows in its log.
    """

    def __init__(self, bench: TrainingBench, approximator: Approximator, schedule: Schedule) -> None:
        self._bench, self._approximator, self._schedule = bench, approximator, schedule
        self._saved = bench.load("approximator") or {"round": 0, "step": 0}
        self._round = 0
        self._sums: dict[str, float] = {}

    def rounds(self, count: int) -> Iterator[int]:
        """The numbers of the rounds from 1, those before the interruption too: later ones need their captures."""
        for self._round in range(1, count + 1):
            yield self._round

    @property
    def passed(self) -> bool:
        """Whether the present round was learned from, watched and followed by another before the interruption."""
        return self._round < int(self._saved["round"])

    def kept(self, name: str, compute: Callable[[], Tensor]) -> Tensor:
        """A phase by name, computed where it is not known yet."""
        phase: Tensor = self._bench.kept(name, lambda: {"phase": compute()})["phase"]
        return phase

    def phases(
        self, purpose: str, number: int, images: Sequence[TrainingImage], retrieve: Callable[[TrainingImage], Tensor]
    ) -> list[Tensor]:
        """The phases ``(C, H, W)`` [rad] of images, which the log counts for a round that is new."""
        phases = []
        for image in images:
            key = f"phase of {purpose} {number} {image.item}"  # in a memory
            phases.append(self.kept(key, partial(retrieve, image)))
            if self._is_new(purpose):
                self.log(0, {"phases": f"{len(phases)} of {len(images)}"})
        return phases

    def captures(
        self, purpose: str, number: int, images: Sequence[TrainingImage], phases: Sequence[Tensor]
    ) -> list[Sample]:
        """The captures of phases, with a row in the log for each of a round that is new."""
        keys = [f"{purpose} {number} {image.item}" for image in images]
        samples = []
        for sample in captured(self._bench, keys, phases, images, purpose, number):
            samples.append(sample)
            if self._is_new(purpose):
                self.log(0, {"images": len(samples)})
        return samples

    def steps(self, samples: Sequence[Sample], count: int) -> Iterator[tuple[Sample, float]]:
        """The samples of the steps that are left of so many, each with the share of the steps before it.

        Every pass through the samples has a random order, the same however often the training is interrupted.
        """
        if self.passed:
            return
        resumed = self._round == self._saved["round"]
        if resumed:
            self._approximator.load_state_dict(self._saved["state"])
        draw, passes = self._bench.generator("order", self._round), -(-count // len(samples))
        order = torch.cat([torch.randperm(len(samples), generator=draw) for _ in range(passes)]).tolist()
        first = self._saved["step"] if resumed else 0
        for step in range(first, count):
            yield samples[order[step]], step / count
            if (step + 1) % STEPS_BETWEEN_SAVES == 0 or step + 1 == count:
                self._save(step + 1, (step - first) % STEPS_BETWEEN_SAVES + 1)

    def add(self, losses: Mapping[str, float]) -> None:
        """The losses of a step, for the next row of the log."""
        self._sums = {name: self._sums.get(name, 0.0) + value for name, value in losses.items()}

    def log(self, step: int, values: Mapping[str, float | str]) -> None:
        """A row of the present round, with the share of all steps that are done after so many of it."""
        steps = [self._schedule.steps_of(number) for number in range(1, self._schedule.rounds + 1)]
        done = sum(steps[: self._round - 1]) + step
        self._bench.log(round=self._round, step=step, share=round(done / sum(steps), 4), **values)

    def watch(self, values: Mapping[str, float]) -> None:
        """Log and keep how far the present round can be trusted, see ``fidelity``."""
        self.log(self._schedule.steps_of(self._round), values)
        self._bench.save(f"fidelity {self._round}", dict(values))

    @property
    def watched(self) -> list[float]:
        """How well each round up to the present one predicted captures of held-out images [dB]."""
        kept = (self._bench.load(f"fidelity {number}") for number in range(1, self._round + 1))
        return [values["fidelity_psnr"] for values in kept if values]

    def _is_new(self, purpose: str) -> bool:
        """Whether what is retrieved and captured is of a round that was not learned from before the interruption."""
        return purpose == "round" and self._round > int(self._saved["round"])

    def _save(self, step: int, count: int) -> None:
        """Log the mean losses of the last ``count`` steps, then keep the approximator."""
        self.log(step, {name: total / count for name, total in self._sums.items() if total})
        state = self._approximator.state_dict()
        self._bench.save("approximator", {"round": self._round, "step": step, "state": state})
        self._sums = {}
