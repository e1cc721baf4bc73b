"""What calibrated methods promise: phases for any target without a capture, a training that a kill does not change,
and plain Wirtinger holography on a display that has nothing to correct."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, cast

import pytest
import torch
from torch import Tensor

from holobench_eval.core.errors import UserError
from holobench_eval.display.api import Capture
from holobench_eval.display.nominal import ideal_image
from holobench_eval.display.training import TrainingBench, TrainingImage
from holobench_eval.methods.calibrated.cnn_prop_cnn import CNNPropCNN
from holobench_eval.methods.calibrated.hybrid import HybridModel
from holobench_eval.methods.calibrated.kernel import LearnedKernel
from holobench_eval.methods.calibrated.method import Calibrated, LargeSteps, SearchRetrieval
from holobench_eval.methods.calibrated.parametric import ParametricModel
from holobench_eval.methods.learned import fallback
from holobench_eval.methods.learned.samples import Schedule
from holobench_eval.methods.wirtinger import Wirtinger
from tests.support.small_training import BentDisplay, Memory, pictures, small_spec, solving_bench, training_bench

SPEC = small_spec(32, 24, colours=3)
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
def test_captures_are_patterns_dark_ones_images_rounds_and_held_out_images_once_a_round_and_twice_for_the_fallback(
    name: str,
) -> None:
    for patterns, rounds, held_out, switch in ((2, 2, 1, False), (0, 1, 2, True)):
        memory = Memory()
        bench = training_bench(SPEC, memory, images=3, held_out=held_out)
        training = replace(SHORT["training"], rounds=rounds)
        replace(METHODS[name], patterns=patterns, training=training, fallback=switch).prepare(bench)
        dark = 3 if name == "parametric_model" else 0
        assert bench.captures == patterns + dark + 3 + (rounds - 1) + (rounds + 2 * switch) * held_out
        assert memory.fate.passed.count("after a photograph") == bench.captures


@names
def test_the_weights_of_another_method_are_refused_in_one_line(name: str) -> None:
    (target,) = pictures(SPEC, first=20)
    others = [other for other in METHODS if other != name and {name, other} != {"parametric_model", "hybrid_model"}]
    for other in others:
        learned = {**METHODS[other].approximator(SPEC).learned(), "fell_back": 0}
        with pytest.raises(UserError, match="not the weights of this") as caught:
            METHODS[name].solve(target[None], solving_bench(METHODS[name], target, SPEC, learned))
        assert "\n" not in str(caught.value)


class PlainDisplay(BentDisplay):
    """The nominal model as a display, without noise."""

    def session(self, names: tuple[object, ...], target: Tensor) -> PlainDisplay:
        return PlainDisplay(self.spec, self.fate, names)

    def announce(self, phases):
        pass

    def capture(self, phase: Tensor) -> Capture:
        frame = ideal_image(phase, self.spec)
        return Capture(frame, dark=0.0, white=float("inf"), gain=(1.0,) * len(frame))


ONE = small_spec(48, 36)
LEARNS: dict[str, Any] = {
    "training": Schedule(1, steps=60),
    "retrieval": LargeSteps(iterations=60),
    "search": SearchRetrieval(iterations=5),
    "patterns": 4,
    "fallback": True,
}


def calibrated_on(display: BentDisplay, method: Calibrated) -> Mapping[str, Any]:
    given = [TrainingImage(f"picture {number}", one) for number, one in enumerate(pictures(ONE, 6))]
    return method.prepare(TrainingBench(cast(Any, display), "small", given[:4], given[4:], Memory(), None, 3))


def test_a_display_without_faults_is_left_to_wirtinger_holography_where_the_switch_is_on() -> None:
    method = LearnedKernel(**LEARNS)
    assert calibrated_on(PlainDisplay(ONE), replace(method, fallback=False))["fell_back"] == 0
    learned = calibrated_on(PlainDisplay(ONE), method)
    assert learned["fell_back"] == 1
    target = pictures(ONE, first=30)
    bench = solving_bench(method, target[0], ONE, learned)
    assert torch.equal(method.solve(target, bench), Wirtinger().solve(target, bench))


def test_a_display_with_faults_is_corrected() -> None:
    method = ParametricModel(**LEARNS | {"training": Schedule(1, steps=120)})
    learned = calibrated_on(BentDisplay(ONE), method)
    assert learned["fell_back"] == 0
    (target,) = pictures(ONE, first=30)
    bench, display = solving_bench(method, target, ONE, learned), BentDisplay(ONE)
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
        bench = training_bench(SPEC, Memory(), images=2, held_out=2)
        assert method.prepare(bench)["fell_back"] == expected
