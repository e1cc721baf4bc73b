"""Algorithm 1: who is captured when, and that a training killed anywhere ends as one that was not."""

import itertools
from collections.abc import Sequence
from typing import Any

import pytest
import torch
from torch import Tensor

from holobench_eval.display.training import TrainingBench, TrainingImage
from holobench_eval.methods.learned import checkpoint
from holobench_eval.methods.learned.algorithm import train
from holobench_eval.methods.learned.checkpoint import Checkpoint
from holobench_eval.methods.learned.fidelity import fidelity
from holobench_eval.methods.learned.retrieval import Image
from holobench_eval.methods.learned.samples import Sample, Schedule
from tests.support.small_training import Fate, Killed, Memory, same, small_spec, training_bench

SPEC = small_spec(size=24, region=16)


class Scale:
    """An approximator of two numbers, whose every step depends on all before it."""

    def __init__(self, fate: Fate) -> None:
        self.fate, self.weight, self.moment = fate, torch.zeros(()), torch.zeros(())
        self.unit = torch.ones(())
        self.exposed: list[int] = []
        self.trained_on: list[tuple[float, float]] = []

    def expose(self, samples: Sequence[Sample]) -> None:
        self.exposed.append(len(samples))
        self.unit = torch.stack([sample.capture.mean() for sample in samples]).mean()

    def step(self, sample: Sample, progress: float) -> dict[str, float]:
        self.fate.meets("a step")
        error = sample.capture.mean() / self.unit - self.weight
        self.moment = 0.7 * self.moment + (1 - progress) * error
        self.weight = self.weight + 0.2 * self.moment
        self.trained_on.append((float(sample.capture.double().sum()), progress))
        return {"error": abs(float(error)), "nothing": 0.0}

    def image(self, light: Tensor) -> Image:
        weight = self.weight.clone()
        return lambda phase: weight * SPEC.region.crop(1 + torch.cos(phase)) / light.view(-1, 1, 1)

    def predicted(self, sample: Sample) -> Tensor:
        return self.image(sample.light)(sample.phase)

    def state_dict(self) -> dict[str, Any]:
        return {"weight": self.weight, "moment": self.moment, "unit": self.unit}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        self.weight, self.moment, self.unit = state["weight"], state["moment"], state["unit"]


def even(value: float) -> Sample:
    return Sample(torch.zeros(1), torch.full((1, 2, 2), value), torch.zeros(1), torch.ones(1))


def begin(image: TrainingImage) -> Tensor:
    return torch.full((1, *SPEC.shape), float(image.target.mean()))


def search(display: Image, target: Tensor, phase: Tensor) -> Tensor:
    return phase + 0.1 + (display(phase).mean() - target.mean())


def run(bench: TrainingBench, rounds: Schedule, memory: Memory) -> Scale:
    approximator = Scale(memory.fate)
    train(bench, approximator, begin, search, rounds)
    return approximator


@pytest.fixture(autouse=True)
def _saves_often(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checkpoint, "STEPS_BETWEEN_SAVES", 3)


@pytest.mark.parametrize("refine_images", [None, 1, 2, 9])
@pytest.mark.parametrize("used", [None, 2])
@pytest.mark.parametrize("held_out", [1, 2])
def test_captures_are_all_images_then_some_a_round_and_those_held_out(refine_images, used, held_out) -> None:
    memory = Memory()
    bench = training_bench(SPEC, memory, images=3, held_out=held_out)
    run(bench, Schedule(3, used, refine_images, steps=4, refine_steps=2), memory)
    images = used or 3
    assert bench.captures == images + 2 * min(refine_images or images, images) + 3 * held_out
    assert memory.fate.passed.count("after a photograph") == bench.captures


def test_every_round_is_captured_under_noise_of_its_own() -> None:
    memory = Memory()
    run(training_bench(SPEC, memory), Schedule(3, steps=2, refine_steps=2), memory)
    captures = [kept["value"]["capture"] for name, kept in memory.kept.items() if "capture" in kept["value"]]
    assert len({float(capture.double().sum()) for capture in captures}) == len(captures) == 12


def test_images_of_later_rounds_go_round_in_turn() -> None:
    memory = Memory()
    images = training_bench(SPEC, memory, images=5).images
    rounds = Schedule(5, images=4, refine_images=3)
    shown = [[image.item[-1] for image in rounds.images_of(number, images)] for number in range(1, 6)]
    assert ["".join(items) for items in shown] == ["0123", "012", "301", "230", "123"]
    everything = Schedule(3, refine_images=None)
    assert [len(everything.images_of(number, images)) for number in (1, 2, 3)] == [5, 5, 5]


@pytest.mark.parametrize(("keep_captures", "seen"), [(True, [3, 5, 7]), (False, [3, 2, 2])])
def test_a_round_learns_from_all_captures_so_far_or_from_its_own(keep_captures: bool, seen: list[int]) -> None:
    memory = Memory()
    rounds = Schedule(3, refine_images=2, steps=21, refine_steps=21, keep_captures=keep_captures)
    approximator = run(training_bench(SPEC, memory), rounds, memory)
    captures = [{value for value, _ in approximator.trained_on[start : start + 21]} for start in (0, 21, 42)]
    assert [len(round_) for round_ in captures] == seen
    assert (captures[0] <= captures[1] <= captures[2]) == keep_captures


@pytest.mark.parametrize("keep_captures", [True, False])
def test_samples_from_before_are_learned_from_in_every_round(keep_captures: bool) -> None:
    memory = Memory()
    bench, approximator = training_bench(SPEC, memory), Scale(memory.fate)
    earlier = [even(value) for value in (5.0, 6.0)]
    rounds = Schedule(2, refine_images=1, steps=5, refine_steps=10, keep_captures=keep_captures)
    train(bench, approximator, begin, search, rounds, earlier)
    assert approximator.exposed == [5]
    learned_from = [value for value, _ in approximator.trained_on]
    for seen in (learned_from[:5], learned_from[5:]):
        assert {20.0, 24.0} <= set(seen)
    assert len(set(learned_from[5:])) == (6 if keep_captures else 3)
    assert bench.captures == 3 + 1 + 2


def test_every_capture_is_learned_from_equally_often_and_not_in_the_order_it_was_taken() -> None:
    memory = Memory()
    approximator = run(training_bench(SPEC, memory, images=6), Schedule(1, steps=18), memory)
    passes = [[value for value, _ in approximator.trained_on[start : start + 6]] for start in (0, 6, 12)]
    assert len({tuple(sorted(one)) for one in passes}) == 1
    assert len({tuple(one) for one in passes}) == 3
    assert [progress for _, progress in approximator.trained_on] == [step / 18 for step in range(18)]


def test_the_order_depends_on_the_study_and_on_the_round() -> None:
    def order(seed: int) -> list[list[float]]:
        memory = Memory()
        rounds = Schedule(2, refine_images=1, steps=6, refine_steps=6, keep_captures=True)
        known = run(training_bench(SPEC, memory, images=6, seed=seed), rounds, memory).trained_on
        first = [value for value, _ in known[:6]]
        ranks = {value: rank for rank, value in enumerate(sorted(first))}
        return [[ranks[value] for value in first], [ranks.get(value, -1) for value, _ in known[6:]]]

    assert order(3) == order(3)
    assert order(3)[0] != order(4)[0]
    assert order(3)[0] != order(3)[1]


def test_the_first_round_shows_the_start_and_later_ones_search_from_it() -> None:
    memory = Memory()
    bench = training_bench(SPEC, memory)
    run(bench, Schedule(2, steps=2, refine_steps=2), memory)
    names = ("start", "phase of round 1", "phase of round 2")
    start, first, second = (memory.load(f"{name} picture 0") for name in names)
    assert torch.equal(start["value"]["phase"], begin(bench.images[0]))
    assert torch.equal(first["value"]["phase"], start["value"]["phase"])
    assert not torch.equal(second["value"]["phase"], start["value"]["phase"])


class Ending(Schedule):
    """Ends with the first round after the first that predicts held-out captures by less than a decibel better."""

    def ends(self, watched: Sequence[float]) -> bool:
        return len(watched) > 1 and watched[-1] - watched[-2] < 1


RESUMED = Schedule(3, images=2, refine_images=1, steps=4, refine_steps=4)
ENDING = Ending(9, images=2, refine_images=1, steps=4, refine_steps=4)


def test_a_schedule_may_end_with_a_round() -> None:
    memory = Memory()
    run(training_bench(SPEC, memory), ENDING, memory)
    watched = [float(row["fidelity_psnr"]) for row in memory.rows if "fidelity_psnr" in row]
    assert 1 < len(watched) < 9
    assert watched[-1] - watched[-2] < 1
    assert all(later - earlier >= 1 for earlier, later in itertools.pairwise(watched[:-1]))


def ended(memory: Memory, fate: Fate | None = None, rounds: Schedule = RESUMED) -> dict[str, Any]:
    """Of a training that goes on from what the memory holds: its state, its captures, its rows and all it kept."""
    bench = training_bench(SPEC, memory, fate)
    state = run(bench, rounds, memory).state_dict()
    values = {name: memory.kept[name]["value"] for name in sorted(memory.kept)}
    return {"state": state, "captures": bench.captures, "rows": memory.story, "values": values}


@pytest.mark.parametrize("rounds", [RESUMED, ENDING])
def test_a_training_killed_at_any_moment_ends_with_the_same_state_captures_values_and_rows(rounds: Schedule) -> None:
    """Between photographs, in and between steps, around every save and row, in every round and with images held out."""
    undisturbed = Memory()
    whole, moments = ended(undisturbed, rounds=rounds), undisturbed.fate.passed
    assert len(moments) > 60
    for at in range(len(moments)):
        memory, fate = Memory(), Fate(at)
        with pytest.raises(Killed):
            ended(memory, fate, rounds)
        assert fate.passed == moments[: at + 1]
        assert same(ended(memory, rounds=rounds), whole), (at, moments[at])


def test_a_training_killed_again_and_again_ends_the_same() -> None:
    memory, kills = Memory(), 0
    while kills < 40:
        try:
            found = ended(memory, Fate(14))
            break
        except Killed:
            kills += 1
    assert 3 < kills < 40
    assert same(found, ended(Memory()))


def test_a_row_tells_the_mean_loss_since_the_row_earlier() -> None:
    memory = Memory()
    bench = training_bench(SPEC, memory)
    approximator, losses = Scale(Fate()), []
    step = approximator.step

    def recorded(sample: Sample, progress: float) -> dict[str, float]:
        losses.append(step(sample, progress)["error"])
        return {"error": losses[-1], "nothing": 0.0}

    approximator.step = recorded  # type: ignore[method-assign]
    samples = [even(value) for value in (1.0, 2.0)]
    kept = Checkpoint(bench, approximator, Schedule(1, steps=8))
    for _ in kept.rounds(1):
        for sample, progress in kept.steps(samples, 8):
            kept.add(approximator.step(sample, progress))
    assert [row["step"] for row in memory.rows] == [3, 6, 8]
    expected = [sum(losses[a:b]) / (b - a) for a, b in ((0, 3), (3, 6), (6, 8))]
    assert [row["error"] for row in memory.rows] == pytest.approx(expected)
    assert [row["share"] for row in memory.rows] == [0.375, 0.75, 1.0]
    assert not any("nothing" in row for row in memory.rows)


def test_fidelity_tells_how_good_prediction_and_capture_are_and_how_close() -> None:
    target = torch.rand(1, *SPEC.region.shape, generator=torch.Generator().manual_seed(0))
    error = 0.1 * (-1.0) ** torch.arange(SPEC.region.width)

    class Perfect(Scale):
        def image(self, light: Tensor) -> Image:
            return lambda phase: 3 * target

    sample = Sample(torch.zeros(1, *SPEC.shape), 0.2 * (target + error), target, torch.ones(1))
    values = fidelity(Perfect(Fate()), [sample, sample])
    assert values["predicted_psnr"] > 100
    assert values["captured_psnr"] == pytest.approx(20, abs=1)
    assert values["fidelity_psnr"] == pytest.approx(20, abs=1)
