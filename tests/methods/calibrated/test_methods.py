"""What calibrated methods promise: phases for any target without a capture, a training that a kill does not change,
and plain Wirtinger holography on a display that has nothing to correct."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, cast

import pytest
import torch
from torch import Tensor

from holobench_eval.core.errors import BudgetError, UserError
from holobench_eval.display.api import Capture
from holobench_eval.display.nominal import ideal_image
from holobench_eval.display.training import TrainingBench, TrainingImage
from holobench_eval.methods.calibrated.cnn_prop_cnn import CNNPropCNN
from holobench_eval.methods.calibrated.hybrid import HybridModel
from holobench_eval.methods.calibrated.kernel import LearnedKernel
from holobench_eval.methods.calibrated.method import Calibrated, LargeSteps, SearchRetrieval
from holobench_eval.methods.calibrated.parametric import ParametricModel
from holobench_eval.methods.calibrated.phase_gamma import WirtingerGamma, curved
from holobench_eval.methods.learned import fallback
from holobench_eval.methods.learned.samples import Schedule
from holobench_eval.methods.wirtinger import Wirtinger
from tests.support import small_training as small

SPEC = small.small_spec(32, 24, colours=3)
SHORT: dict[str, Any] = {
    "training": Schedule(2, refine_images=1, steps=4, refine_steps=2),
    "retrieval": LargeSteps(iterations=3),
    "search": SearchRetrieval(iterations=2),
    "start": Wirtinger(iterations=2),
    "patterns": 2,
}
METHODS: dict[str, Calibrated] = {
    "parametric_model": ParametricModel(**SHORT),
    "learned_kernel": LearnedKernel(**SHORT),
    "cnn_prop_cnn": CNNPropCNN(width=3, **SHORT),
    "hybrid_model": HybridModel(width=4, **SHORT),
}
names = pytest.mark.parametrize("name", METHODS)


@pytest.fixture(autouse=True)
def _short_dark_patterns(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("holobench_eval.methods.calibrated.patterns.Wirtinger", lambda: Wirtinger(iterations=5))


@pytest.mark.parametrize("name", ["parametric_model", "learned_kernel"])
def test_captures_are_patterns_images_rounds_and_held_out_images_twice_more_for_the_fallback(name: str) -> None:
    for patterns, rounds, held_out, switch in ((2, 2, 1, False), (0, 1, 2, True)):
        memory = small.Memory()
        bench = small.training_bench(SPEC, memory, images=3, held_out=held_out)
        training = replace(SHORT["training"], rounds=rounds)
        replace(METHODS[name], patterns=patterns, training=training, fallback=switch).prepare(bench)
        dark = 3 if name == "parametric_model" else 0
        assert bench.captures == patterns + dark + 3 + (rounds - 1) + (rounds + 2 * switch) * held_out
        assert memory.fate.passed.count("after a photograph") == bench.captures


@names
def test_the_weights_of_another_method_are_refused_in_one_line(name: str) -> None:
    (target,) = small.pictures(SPEC, first=20)
    others = [other for other in METHODS if other != name and {name, other} != {"parametric_model", "hybrid_model"}]
    for other in others:
        learned = {**METHODS[other].approximator(SPEC).learned(), "fell_back": 0}
        with pytest.raises(UserError, match="not the weights of this") as caught:
            METHODS[name].solve(target[None], small.solving_bench(METHODS[name], target, SPEC, learned))
        assert "\n" not in str(caught.value)


class PlainDisplay(small.BentDisplay):
    """The nominal model as a display, without noise."""

    def session(self, names: tuple[object, ...], target: Tensor) -> "PlainDisplay":
        return PlainDisplay(self.spec, self.fate, names)

    def announce(self, phases):
        pass

    def capture(self, phase: Tensor) -> Capture:
        frame = ideal_image(phase, self.spec)
        return Capture(frame, dark=0.0, white=float("inf"), gain=(1.0,) * len(frame))


ONE = small.small_spec(48, 36)
LEARNS: dict[str, Any] = {
    "training": Schedule(1, steps=60),
    "retrieval": LargeSteps(iterations=60),
    "search": SearchRetrieval(iterations=5),
    "patterns": 4,
    "fallback": True,
}


def calibrated_on(display: small.BentDisplay, method: Calibrated) -> Mapping[str, Any]:
    given = [TrainingImage(f"picture {number}", one) for number, one in enumerate(small.pictures(ONE, 6))]
    return method.prepare(TrainingBench(cast(Any, display), "small", given[:4], given[4:], small.Memory(), None, 3))


def test_a_display_without_faults_is_left_to_wirtinger_holography_where_the_switch_is_on() -> None:
    method = LearnedKernel(**LEARNS)
    assert calibrated_on(PlainDisplay(ONE), replace(method, fallback=False))["fell_back"] == 0
    learned = calibrated_on(PlainDisplay(ONE), method)
    assert learned["fell_back"] == 1
    target = small.pictures(ONE, first=30)
    bench = small.solving_bench(method, target[0], ONE, learned)
    assert torch.equal(method.solve(target, bench), Wirtinger().solve(target, bench))


def test_a_display_with_faults_is_corrected() -> None:
    method = ParametricModel(**LEARNS | {"training": Schedule(1, steps=120)})
    learned = calibrated_on(small.BentDisplay(ONE), method)
    assert learned["fell_back"] == 0
    (target,) = small.pictures(ONE, first=30)
    bench, display = small.solving_bench(method, target, ONE, learned), small.BentDisplay(ONE)
    errors = []
    for way in (method, Wirtinger()):
        shown = display.rectified(display.capture(way.solve(target[None], bench)[0]), target)
        shown = shown * (shown * target).sum() / shown.square().sum()
        errors.append(float((shown - target).square().mean()))
    assert errors[0] < errors[1] / 5


def test_the_fallback_is_taken_by_the_mean_over_the_held_out_images(monkeypatch: pytest.MonkeyPatch) -> None:
    scores = iter([20.0, 25.0, 21.0, 23.0, 20.0, 21.0, 22.0, 20.0])
    monkeypatch.setattr(fallback, "matched_psnr", lambda shown, target: next(scores))
    monkeypatch.setattr(fallback, "WIRTINGER", Wirtinger(iterations=1))
    method = replace(METHODS["parametric_model"], fallback=True)
    for expected in (0, 1):
        bench = small.training_bench(SPEC, small.Memory(), images=2, held_out=2)
        assert method.prepare(bench)["fell_back"] == expected


TWO = small.small_spec(colours=2)
GAMMA = WirtingerGamma(images=2, of=Wirtinger(iterations=30))


@dataclass
class LutDisplay(small.BentDisplay):
    """A display whose look-up table has an exponent."""

    exponent: float = 1.0

    def session(self, names: tuple[object, ...], target: Tensor) -> "LutDisplay":
        return LutDisplay(self.spec, self.fate, names, self.exponent)

    def capture(self, phase: Tensor) -> Capture:
        self.fate.meets("photograph")
        frame = ideal_image(curved(phase, self.exponent), self.spec)
        return Capture(frame, dark=0.0, white=math.inf, gain=(1.0,) * len(frame))


def bench(exponent: float, memory: small.Memory | None = None, budget: int | None = None) -> TrainingBench:
    memory = memory or small.Memory()
    images = [TrainingImage(f"image {number}", picture) for number, picture in enumerate(small.pictures(TWO, 4))]
    display = cast(Any, LutDisplay(TWO, memory.fate, exponent=exponent))
    return TrainingBench(display, "gamma", images[:3], images[3:], memory, budget, 1)


@pytest.mark.parametrize("exponent", [0.8, 1.0, 1.4])
def test_the_gamma_is_the_inverse_of_the_look_up_tables_exponent(exponent: float) -> None:
    found = GAMMA.prepare(bench(exponent))["gamma"]
    assert abs(math.log2(found * exponent)) <= 1 / 24 + 1e-6  # half a step of the search


def test_it_takes_thirteen_captures_an_image_and_no_more() -> None:
    exact = bench(1.2, budget=2 * 13)
    GAMMA.prepare(exact)
    assert exact.captures == 2 * 13
    with pytest.raises(BudgetError):
        GAMMA.prepare(bench(1.2, budget=2 * 13 - 1))


def test_a_killed_search_goes_on_and_gives_the_same_gamma() -> None:
    memory = small.Memory()
    whole = GAMMA.prepare(bench(1.2, memory))
    moments = len(memory.fate.passed)
    for at in range(0, moments, 17):
        again = small.Memory()
        again.fate = small.Fate(at)
        with pytest.raises(small.Killed):
            GAMMA.prepare(bench(1.2, again))
        again.fate = small.Fate()
        resumed = bench(1.2, again)
        assert GAMMA.prepare(resumed) == whole
        assert resumed.captures == 2 * 13
        assert again.story == memory.story


def test_the_hologram_is_that_of_the_open_loop_method_curved() -> None:
    (target,) = small.pictures(TWO, first=9)
    phase = GAMMA.solve(target[None], small.solving_bench(GAMMA, target, TWO, {"gamma": 1.3}))
    plain = GAMMA.of.solve(target[None], small.solving_bench(GAMMA.of, target, TWO, {}))
    assert torch.equal(phase, math.tau * (plain.remainder(math.tau) / math.tau) ** 1.3)
