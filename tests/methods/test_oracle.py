import pytest
import torch

from holobench_eval.methods.losses import intensity_l2
from holobench_eval.methods.oracle import Oracle
from holobench_eval.methods.wirtinger import Wirtinger


def bench_loss(phase, target, bench):
    return intensity_l2(bench.simulation.image(phase), target)


def test_the_oracle_corrects_what_the_nominal_model_does_not_know(bench, scene):
    target = scene(channels=3)
    blind, knowing = Wirtinger().solve(target, bench)[0], Oracle().solve(target, bench)[0]
    assert (bench_loss(knowing, target[0], bench) < 0.2 * bench_loss(blind, target[0], bench)).all()


def test_the_oracle_never_falls_behind_its_start(bench, scene):
    target = scene()
    start = bench_loss(Wirtinger(iterations=9).solve(target, bench)[0], target[0], bench)
    # a step that can only make it worse
    phase = Oracle(iterations=3, step=10.0, start_iterations=9).solve(target, bench)[0]
    assert bench_loss(phase, target[0], bench) <= start * (1 + 1e-5)


def test_without_a_simulated_bench_the_refusal_reaches_the_caller(bench, scene):
    class Hardware(type(bench)):
        @property
        def simulation(self):
            raise LookupError("no simulated bench here")

    with pytest.raises(LookupError, match="no simulated bench"):
        Oracle(iterations=1).solve(scene(), Hardware(bench.spec))


def test_the_oracle_returns_a_phase_free_of_its_graph(bench, scene):
    phase = Oracle(iterations=2).solve(scene(), bench)
    assert not phase.requires_grad
    assert phase.dtype == torch.float32
