from dataclasses import replace

import pytest
import torch

from holobench_eval.display import load_profile
from holobench_eval.display.simulated.stages.lut import Flicker
from holobench_eval.methods.descent import adam
from holobench_eval.methods.losses import intensity_l2
from holobench_eval.methods.simulated import descent
from holobench_eval.methods.simulated.descent import expected_error, squared_error
from holobench_eval.methods.simulated.oracle import Oracle
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.metrics import match
from holobench_eval.study.opening import open_bench


def bench_loss(phase, target, bench):
    return intensity_l2(bench.simulation.expected(phase, target)[0], target)


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


def test_a_better_phase_of_another_method_is_picked_up_in_the_colour_where_it_is_better(bench, scene):
    target = scene(channels=3)
    short = Oracle(iterations=1, step=1e-6, rounds=1)  # a descent that finds nothing
    good = Oracle(rounds=2).solve(target, bench)[0]
    own = short.solve(target, bench)[0]
    planted = torch.stack([torch.zeros_like(good[0]), good[1], torch.zeros_like(good[2])])
    phase = short.solve(target, replace(bench, starts=(torch.zeros_like(good), planted)))[0]
    assert torch.allclose(phase[1], good[1], atol=1e-4)
    assert torch.allclose(phase[[0, 2]], own[[0, 2]], atol=1e-4)


def test_rounds_go_on_until_they_bring_less_than_the_tolerance(bench, scene, monkeypatch):
    calls = []
    monkeypatch.setattr(descent, "adam", lambda *args, **kwargs: calls.append(1) or adam(*args, **kwargs))
    Oracle(iterations=4, tolerance=10.0).solve(scene(), bench)
    assert len(calls) == 1
    Oracle(iterations=4, tolerance=0.01, rounds=6).solve(scene(), bench)
    assert len(calls) == 1 + 6


@pytest.fixture(scope="module")
def shown():
    """A target on `leto-aged`, and a phase that the noise of the camera matters for."""
    display = open_bench(load_profile("leto-aged"), (128, 128), 1)
    target = torch.rand(1, 3, 6, 6, generator=torch.Generator().manual_seed(2))
    target = torch.nn.functional.interpolate(target, display.spec.region.shape, mode="bilinear")
    handle = display.for_method(Oracle(), "oracle", target[0], "t", 0)
    return target[0], Oracle(rounds=3).solve(target, handle)[0]


@pytest.mark.parametrize("name", ["ideal", "leto-aged"])
def test_the_expected_error_is_the_mean_over_captures(name, shown):
    target, phase = shown
    display = open_bench(replace(load_profile(name), flicker=Flicker()), (128, 128), 1)
    captures = [display.photograph(phase, target, "t", repeat).image for repeat in range(4)]
    errors = torch.stack([(match(one, target)[0] - target).square().mean() for one in captures])
    expected = expected_error(phase, display.simulation, target).mean()
    assert abs(float(10 * (expected / errors.mean()).log10())) < (1e-3 if name == "ideal" else 0.02)


def test_two_gains_stand_for_all_of_flicker(shown):
    target, phase = shown
    profile = load_profile("leto-aged")
    bench = open_bench(profile, (128, 128), 1).simulation
    draws = torch.randn(50, generator=torch.Generator().manual_seed(4)).tolist()
    with torch.no_grad():
        errors = [
            squared_error(phase, bench, target, 1 + sign * profile.flicker.rms * draw)
            for draw in draws
            for sign in (1, -1)
        ]
    scale = torch.tensor(draws).square().mean()  # of the drawn numbers, whose variance is not 1
    at_rest = squared_error(phase, bench, target).mean()
    excess = (torch.stack(errors).mean() - at_rest) / scale
    assert abs(float(10 * ((at_rest + excess) / expected_error(phase, bench, target).mean()).log10())) < 0.05
