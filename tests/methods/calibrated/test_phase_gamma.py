"""The gamma of open-loop holograms, found with captures."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, cast

import pytest
import torch
from torch import Tensor

from holobench_eval.core.errors import BudgetError
from holobench_eval.display.api import Capture
from holobench_eval.display.nominal import ideal_image
from holobench_eval.display.training import TrainingBench, TrainingImage
from holobench_eval.methods.calibrated.phase_gamma import WirtingerGamma, curved
from holobench_eval.methods.wirtinger import Wirtinger
from tests.support.small_training import BentDisplay, Fate, Killed, Memory, pictures, small_spec, solving_bench

SPEC = small_spec(colours=2)
SHORT = WirtingerGamma(images=2, of=Wirtinger(iterations=30))


@dataclass
class LutDisplay(BentDisplay):
    """A display whose look-up table has an exponent."""

    exponent: float = 1.0

    def session(self, names: tuple[object, ...], target: Tensor) -> LutDisplay:
        return LutDisplay(self.spec, self.fate, names, self.exponent)

    def capture(self, phase: Tensor) -> Capture:
        self.fate.meets("photograph")
        frame = ideal_image(curved(phase, self.exponent), self.spec)
        return Capture(frame, dark=0.0, white=math.inf, gain=(1.0,) * len(frame))


def bench(exponent: float, memory: Memory | None = None, budget: int | None = None) -> TrainingBench:
    memory = memory or Memory()
    images = [TrainingImage(f"image {number}", picture) for number, picture in enumerate(pictures(SPEC, 4))]
    display = cast(Any, LutDisplay(SPEC, memory.fate, exponent=exponent))
    return TrainingBench(display, "gamma", images[:3], images[3:], memory, budget, 1)


@pytest.mark.parametrize("exponent", [0.8, 1.0, 1.4])
def test_the_gamma_is_the_inverse_of_the_look_up_tables_exponent(exponent: float) -> None:
    found = SHORT.prepare(bench(exponent))["gamma"]
    assert abs(math.log2(found * exponent)) <= 1 / 24 + 1e-6  # half a step of the search


def test_it_takes_thirteen_captures_an_image_and_no_more() -> None:
    exact = bench(1.2, budget=2 * 13)
    SHORT.prepare(exact)
    assert exact.captures == 2 * 13
    with pytest.raises(BudgetError):
        SHORT.prepare(bench(1.2, budget=2 * 13 - 1))


def test_a_killed_search_goes_on_and_gives_the_same_gamma() -> None:
    memory = Memory()
    whole = SHORT.prepare(bench(1.2, memory))
    moments = len(memory.fate.passed)
    for at in range(0, moments, 9):
        again = Memory()
        again.fate = Fate(at)
        with pytest.raises(Killed):
            SHORT.prepare(bench(1.2, again))
        again.fate = Fate()
        resumed = bench(1.2, again)
        assert SHORT.prepare(resumed) == whole
        assert resumed.captures == 2 * 13
        assert again.story == memory.story


def test_the_hologram_is_that_of_the_open_loop_method_curved() -> None:
    (target,) = pictures(SPEC, first=9)
    phase = SHORT.solve(target[None], solving_bench(SHORT, target, SPEC, {"gamma": 1.3}))
    plain = SHORT.of.solve(target[None], solving_bench(SHORT.of, target, SPEC, {}))
    assert torch.equal(phase, math.tau * (plain.remainder(math.tau) / math.tau) ** 1.3)
