from itertools import pairwise

import pytest
import torch

from holobench_eval.methods.common import nominal_model
from holobench_eval.methods.gerchberg_saxton import GerchbergSaxton, as_bright, step
from holobench_eval.methods.hio import HybridInputOutput
from holobench_eval.methods.initial_phase import initial_phase


@pytest.mark.parametrize("pupil", [None, 0.6])
@pytest.mark.parametrize("start", ["random", "constant"])
def test_the_error_never_rises(pupil, start, make_bench, scene):
    bench, target = make_bench(pupil=pupil), scene(dtype=torch.float64)[:, 0]
    model, region = nominal_model(bench, 0, target), bench.spec.region
    phase = initial_phase(start, target, bench, 0)
    amplitude = as_bright(target, phase, model, region)
    errors = []
    for _ in range(40):
        phase, error = step(phase, amplitude, model, region)
        errors.append(float(error))
    assert all(after <= before * (1 + 1e-12) for before, after in pairwise(errors))
    assert errors[-1] < 0.5 * errors[0]


def test_the_target_gets_the_light_that_the_start_sends_into_the_region(bench, scene):
    target = scene(dtype=torch.float64)[:, 0]
    model, region = nominal_model(bench, 0, target), bench.spec.region
    phase = initial_phase("random", target, bench, 0)
    amplitude = as_bright(target, phase, model, region)
    found = region.crop(model.forward(torch.polar(torch.ones_like(phase), phase))).abs()
    assert amplitude.square().sum() == pytest.approx(float(found.square().sum()))
    assert torch.allclose(amplitude.square() / target.clamp_min(1e-9), (amplitude.square() / target)[:, :1, :1])


def test_a_hologram_that_is_already_exact_stays(bench, scene):
    target = scene(dtype=torch.float64)[:, 0]
    model, region = nominal_model(bench, 0, target), bench.spec.region
    phase = initial_phase("random", target, bench, 0)
    exact = region.crop(model.forward(torch.polar(torch.ones_like(phase), phase))).abs()
    after, error = step(phase, exact, model, region)
    assert float(error) < 1e-20
    assert torch.allclose(torch.remainder(after - phase + 1, 2 * torch.pi), torch.ones_like(phase))


def test_hio_converges_further_than_gerchberg_saxton(bench, scene, linear_psnr):
    target = scene()
    plain = linear_psnr(GerchbergSaxton(iterations=60).solve(target, bench), target, bench)
    assert linear_psnr(HybridInputOutput(iterations=60).solve(target, bench), target, bench) > plain + 1


def test_hio_returns_the_best_phase_that_it_saw(bench, scene, linear_psnr):
    """At beta = 2 the iteration oscillates; its returned error falls all the same as it runs on."""
    target = scene()[:, 0].double()
    model, region = nominal_model(bench, 0, target), bench.spec.region
    start = initial_phase("random", target, bench, 0)
    amplitude = as_bright(target, start, model, region)
    errors = []
    for iterations in (1, 2, 5, 10, 20, 30):
        phase = HybridInputOutput(iterations=iterations, beta=2, offset="none").solve(target[:, None], bench)[:, 0]
        errors.append(float(step(phase, amplitude, model, region)[1]))
    assert errors == sorted(errors, reverse=True)
