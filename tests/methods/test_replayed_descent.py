"""Descent on a device that records an iteration and replays it, which the CPU plays here, gives what a loop gives."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor

from holobench_eval.core import plugins
from holobench_eval.core.graphs import WARM_UP
from holobench_eval.display import load_profile
from holobench_eval.methods.descent import adam, by_autograd
from holobench_eval.methods.hil.approximator import NetworkApproximator
from holobench_eval.methods.hil.networks import Network
from holobench_eval.methods.hil.tuned import SmoothStart
from holobench_eval.methods.learned.retrieval import PhaseRetrieval, retrieve
from holobench_eval.methods.learned.samples import Sample
from holobench_eval.methods.losses import LOSSES
from holobench_eval.methods.multi_plane import MultiPlane
from holobench_eval.methods.sgd import AmplitudeSGD
from holobench_eval.methods.simulated.oracle import Oracle
from holobench_eval.methods.wirtinger import Wirtinger
from tests.support.benches.replaying import fake_device

ITERATIONS = 14
REPLAYS = ITERATIONS - WARM_UP - 1

METHODS: dict[str, Any] = {
    **{loss: Wirtinger(iterations=ITERATIONS, loss=loss, offset="none") for loss in LOSSES},
    "a falling step": Wirtinger(iterations=ITERATIONS, schedule="cosine", offset="none"),
    # losses fall and rise again, so that the last phases are not the best
    "too large a step": Wirtinger(iterations=ITERATIONS, step=0.8, offset="none"),
    "sgd": AmplitudeSGD(iterations=ITERATIONS, offset="none"),
    "multi_plane": MultiPlane(iterations=ITERATIONS, offset="none"),
    "oracle": Oracle(iterations=ITERATIONS, start_iterations=1, rounds=1),
}


def solved(method: Any, target: Tensor, bench: Any, **device: bool) -> tuple[Tensor, int]:
    """The phase, and how many iterations were replayed."""
    with fake_device(**device) as cuda:
        return method.solve(target, bench), cuda.replays


@pytest.mark.parametrize("name", METHODS)
def test_replayed_iterations_give_the_phases_of_a_loop(name: str, make_bench: Any, scene: Any) -> None:
    bench = make_bench(size=176, region=162) if name == "ms_ssim" else make_bench()
    target = scene(size=bench.spec.region.height, batch=2, channels=3 if name == "oracle" else 1)
    replayed, replays = solved(METHODS[name], target, bench)
    looped, _ = solved(METHODS[name], target, bench, records=False)
    assert replays == (2 * REPLAYS if name == "oracle" else REPLAYS)
    assert torch.equal(replayed, looped)


# A step that is too large magnifies rounding, and the bench of the oracle is of single precision.
@pytest.mark.parametrize("name", [name for name in METHODS if name not in ("too large a step", "oracle")])
def test_they_give_those_of_the_cpu_within_rounding(name: str, make_bench: Any, scene: Any) -> None:
    """In double precision, but for the step, a number of single precision on a GPU."""
    bench = make_bench(size=176, region=162) if name == "ms_ssim" else make_bench()
    target = scene(size=bench.spec.region.height, dtype=torch.float64)
    replayed, _ = solved(METHODS[name], target, bench)
    expected = METHODS[name].solve(target, bench)
    assert (replayed - expected).norm() < 1e-5 * expected.norm()


def test_a_tolerance_ends_a_replayed_start_where_it_ends_a_loop(bench: Any, scene: Any) -> None:
    target, start = scene(), SmoothStart(iterations=100, tolerance=0.05)
    replayed, replays = solved(start, target, bench)
    looped, _ = solved(start, target, bench, records=False)
    assert 0 < replays < 100 - WARM_UP - 1
    assert torch.equal(replayed, looped)


@pytest.mark.parametrize("threshold", [0.0, 0.01])
def test_a_retrieval_through_a_model_replays_and_ends_alike(threshold: float, bench: Any, scene: Any) -> None:
    target, settings = scene(channels=3)[0], PhaseRetrieval(ITERATIONS, 0.1, 0.0, 0.0, threshold=threshold)
    image: Callable[[Tensor], Tensor] = bench.simulation.image
    start = torch.zeros(3, *bench.spec.shape)
    with fake_device() as cuda:
        replayed = retrieve(image, target, start, settings)
    with fake_device(records=False):
        looped = retrieve(image, target, start, settings)
    assert (0 < cuda.replays < REPLAYS) if threshold else (cuda.replays == REPLAYS)
    assert torch.equal(replayed, looped)


@pytest.mark.parametrize("name", ["hil", "cnn_prop_cnn", "hybrid_model"])
def test_a_retrieval_through_a_learned_display_is_replayed_with_every_term_of_its_loss(name: str) -> None:
    spec = load_profile("leto-aged").spec((208, 208))
    draw = torch.Generator().manual_seed(1)
    target, phase = (torch.rand(3, *shape, generator=draw) for shape in (spec.region.shape, spec.shape))
    if name == "hil":
        model: Any = NetworkApproximator(spec, Network(levels=3, width=4), None, with_critic=True, seed=0)
    else:
        model = plugins.build("methods", name, {"width": 4}, Path()).approximator(spec)
    model.expose([Sample(phase, 0.5 * target, target, torch.ones(3))])
    image, found = model.image(torch.ones(3)), []
    for records in (True, False):
        with fake_device(records=records) as cuda:
            verdict = model.verdict if name == "hil" else None
            found.append(retrieve(image, target, phase, PhaseRetrieval(iterations=5), verdict))
        assert cuda.replays == (5 - WARM_UP - 1 if records else 0)
    assert torch.equal(found[0], found[1])


def test_a_loss_that_reads_a_number_is_followed_all_the_same() -> None:
    def loss(phase: Tensor) -> Tensor:
        error = (phase - 1).square().mean((1, 2))
        return error if float(error.detach().sum()) > 1e-3 else 2 * error

    with fake_device() as cuda:
        found = adam(torch.zeros(2, 3, 3), by_autograd(loss), 60, 0.1, decay=True)
    assert cuda.replays == 0
    assert torch.allclose(found, torch.ones(2, 3, 3), atol=0.02)
