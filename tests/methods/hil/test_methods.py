"""What the trained methods promise: phases for any target, no camera, and predictions of what their retrieval saw."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest
import torch

from holobench_eval.core import plugins
from holobench_eval.core.errors import CellError, UserError
from holobench_eval.methods.hil.approximator_loss import ApproximatorLoss
from holobench_eval.methods.hil.hil import HIL
from holobench_eval.methods.hil.networks import Network
from holobench_eval.methods.hil.nh3d import HILNH3D
from holobench_eval.methods.hil.tuned import HILTuned, SmoothStart
from holobench_eval.methods.learned import fallback
from holobench_eval.methods.learned.retrieval import PhaseRetrieval
from holobench_eval.methods.learned.samples import Schedule
from holobench_eval.methods.wirtinger import Wirtinger
from tests.support.small_training import Memory, pictures, small_spec, solving_bench, through_a_file, training_bench

SPEC = small_spec(48, 40, colours=3)
SHORT: dict[str, Any] = {
    "training": Schedule(2, refine_images=1, steps=4, refine_steps=2),
    "start": SmoothStart(iterations=2),
}
PLAIN = PhaseRetrieval(iterations=2, perceptual=0.0, ms_ssim=0.0, adversarial=0.0)
SMALL = Network(levels=2, width=4)
METHODS: dict[str, Any] = {
    "hil": HIL(
        network=SMALL, loss=ApproximatorLoss(perceptual=0.0), retrieval=replace(PLAIN, adversarial=0.1), **SHORT
    ),
    "hil_tuned": HILTuned(
        network=SMALL, loss=ApproximatorLoss(l1=1.0, perceptual=0.0), retrieval=PLAIN, offsets=2, **SHORT
    ),
    "hil_nh3d": HILNH3D(network=Network("unet", levels=2, width=4), retrieval=PLAIN, **SHORT),
}
names = pytest.mark.parametrize("name", METHODS)


def train(method: Any, seed: int = 3) -> Mapping[str, Any]:
    """What ``prepare`` gives, as it comes back from its file."""
    bench = training_bench(SPEC, Memory(), images=2, seed=seed)
    return through_a_file(dict(method.prepare(bench)))


@pytest.fixture(scope="module")
def learned() -> dict[str, Mapping[str, Any]]:
    return {name: train(method) for name, method in METHODS.items()}


@names
def test_retrieval_moves_the_phase(name: str, learned: dict[str, Mapping[str, Any]]) -> None:
    target = pictures(SPEC, first=20)
    still = replace(METHODS[name], retrieval=replace(METHODS[name].retrieval, iterations=0))
    bench = solving_bench(still, target[0], SPEC, learned[name])
    start = still.start.solve(target, bench) + learned[name].get("offset", 0.0)
    assert torch.equal(still.solve(target, bench), start)
    assert not torch.equal(METHODS[name].solve(target, bench), start)


@names
def test_what_was_learned_is_needed_and_must_fit(name: str, learned: dict[str, Mapping[str, Any]]) -> None:
    (target,) = pictures(SPEC, first=20)
    wider = replace(METHODS[name], network=replace(METHODS[name].network, width=6))
    with pytest.raises(UserError, match="not the weights of this network"):
        wider.solve(target[None], solving_bench(wider, target, SPEC, learned[name]))
    bench = solving_bench(METHODS[name], target, SPEC, learned[name])
    bench._learned = None
    with pytest.raises(CellError, match="was not trained"):
        METHODS[name].solve(target[None], bench)


def test_a_method_keeps_its_own_defaults_for_parameters_that_are_not_given() -> None:
    method = plugins.build("methods", "hil_plus", {"retrieval": {"iterations": 5}})
    assert (method.retrieval.perceptual, method.retrieval.step) == (0.0, 0.1)


def test_the_constant_phase_is_the_one_whose_captures_are_closest_and_one_alone_needs_none() -> None:
    memory = Memory()
    bench = training_bench(SPEC, memory, images=2)
    method = replace(METHODS["hil_tuned"], offsets=4, training=Schedule(1, steps=1))
    offset = method.prepare(bench)["offset"]
    kept = memory.load("offset")
    errors = kept["value"]["errors"]
    assert offset == pytest.approx(errors.index(min(errors)) * torch.pi / 2)
    assert kept["captures"] == 4 * 2
    assert bench.captures == 4 * 2 + 2 + 1
    assert len(set(errors)) == 4
    alone = training_bench(SPEC, Memory(), images=2)
    assert replace(method, offsets=1).prepare(alone)["offset"] == 0
    assert alone.captures == 2 + 1


def test_hil_starts_at_plain_wirtinger_holography_and_takes_no_capture_beside_those_of_its_rounds() -> None:
    """As published; the baseline runs Wirtinger holography to convergence, and so does hil."""
    assert plugins.build("methods", "hil", {}).start == plugins.build("methods", "wirtinger", {})
    bench = training_bench(SPEC, Memory(), images=2)
    learned = replace(METHODS["hil"], training=Schedule(1, steps=1)).prepare(bench)
    assert bench.captures == 2 + 1
    assert "offset" not in learned


# The third takes the way of hil.
@pytest.mark.parametrize("name", ["hil", "hil_nh3d"])
def test_the_fallback_is_taken_where_wirtinger_holograms_are_captured_closer_and_counts_its_captures(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    method = replace(METHODS[name], fallback=True, retrieval=replace(METHODS[name].retrieval, iterations=0))
    worse = replace(method, start=SmoothStart(iterations=1))  # nothing of a picture yet
    (target,) = pictures(SPEC, first=20)
    benches = [training_bench(SPEC, Memory(), images=2) for _ in range(2)]
    off = dict(replace(worse, fallback=False).prepare(benches[0]))
    on = dict(worse.prepare(benches[1]))
    assert (off["fell_back"], on["fell_back"]) == (0, 1)
    assert benches[1].captures == benches[0].captures + 2  # one held-out image by either
    phase = worse.solve(target[None], solving_bench(worse, target, SPEC, on))
    assert torch.equal(phase, Wirtinger().solve(target[None], solving_bench(worse, target, SPEC, on)))
    monkeypatch.setattr(fallback, "WIRTINGER", Wirtinger(iterations=1))
    assert not method.prepare(training_bench(SPEC, Memory(), images=2))["fell_back"]


def test_hil_trains_and_solves_on_a_small_panel_and_says_what_its_loss_lacks() -> None:
    spec = small_spec(64, 52, colours=3)
    method = replace(METHODS["hil"], retrieval=PhaseRetrieval(iterations=2, step=0.06))
    learned = method.prepare(training_bench(spec, Memory(), images=2))
    assert learned["left_out"] == "MS-SSIM at 2 of its 5 scales and the perceptual distance"
    target = pictures(spec, first=20)
    phase = method.solve(target, solving_bench(method, target[0], spec, learned))
    assert not torch.equal(phase, method.start.solve(target, solving_bench(method, target[0], spec, learned)))
