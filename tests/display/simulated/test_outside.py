"""Displays outside the form of the stages: repeatable, unlike their base but as bright, and good to register."""

import pytest
import torch

from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.study.opening import open_bench
from tests.support.benches import outside

PANEL = (144, 144)


@pytest.fixture(params=outside.NAMES)
def profile(request, tmp_path):
    return outside.profile(request.param, tmp_path)


@pytest.fixture
def shown():
    """A phase that is smooth over a few pixels, with wraps."""
    draw = torch.Generator().manual_seed(1)
    coarse = torch.randn(1, 3, 36, 36, generator=draw)
    return 4 * torch.nn.functional.interpolate(coarse, size=PANEL, mode="bicubic")[0]


def test_without_faults_is_its_base(profile, shown):
    scaled = profile.scaled(PANEL)
    plain, base = (build(scaled).image(shown) for build in (outside.Outside, SimulatedBench))
    assert float((plain - base).norm() / base.norm()) < 1e-3


def test_is_repeatable_and_differs_from_its_base_in_more_than_brightness(profile, shown):
    kind, scaled = outside.NAMES[profile.name], profile.scaled(PANEL)
    odd, again, base = (build(scaled).image(shown) for build in (kind, kind, SimulatedBench))
    assert torch.equal(odd, again)
    assert float(odd.mean() / base.mean()) == pytest.approx(1, abs=0.1)
    assert 0.05 < float((odd * (base.mean() / odd.mean()) - base).norm() / base.norm()) < 0.5


def test_light_follows_its_gradient(profile, shown):
    """Of a phase without wraps, at which the light jumps: a patch gets as much more light as its gradient says."""
    bench, unwrapped = outside.NAMES[profile.name](profile.scaled(PANEL)), 3 + 2 * torch.tanh(shown[1])
    patch = torch.zeros(288, 288)
    patch[100:140, 90:150] = 1
    phase = unwrapped.clone().requires_grad_()
    (gradient,) = torch.autograd.grad((bench.integrated(phase, 1) * patch).sum(), phase)
    step = 0.03 * gradient / gradient.square().mean().sqrt()
    ahead, behind = ((bench.integrated(unwrapped + move, 1) * patch).sum() for move in (step, -step))
    assert float((ahead - behind) / 2) == pytest.approx(float((gradient * step).sum()), rel=0.02)


def test_registers_where_it_is_installed_alone(profile):
    with outside.installed():
        display = open_bench(profile, PANEL)
    assert type(display.bench) is outside.NAMES[profile.name]
    assert max(display.registration.residual) < profile.residual_bound
    assert type(open_bench(profile, PANEL).bench) is SimulatedBench
