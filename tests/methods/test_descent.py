"""Passes and steps of a descent are torch's, compiled or not; where it begins, and what an offset leaves."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from holobench_eval.core import compiled
from holobench_eval.display.api import Region
from holobench_eval.methods.common import nominal_model, per_channel, unit_field, with_offset
from holobench_eval.methods.descent import Adam, adam, by_autograd
from holobench_eval.methods.initial_phase import initial_phase
from holobench_eval.methods.losses import LOSSES, amplitude_l2, intensity_l2
from holobench_eval.methods.phase_propagation import PhasePropagation
from holobench_eval.methods.sgd import AmplitudeSGD
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.optics import AngularSpectrum

MODEL = AngularSpectrum((90, 131), pitch=6.4e-6, wavelength=517e-9, distance=3e-3)
REGIONS = [Region(0, 0, 90, 131), Region(7, 20, 61, 83), Region(0, 100, 3, 31), Region(80, 1, 10, 1)]


def pair(region: Region, batch: int = 2, model: AngularSpectrum = MODEL) -> tuple[torch.Tensor, torch.Tensor]:
    draw = torch.Generator().manual_seed(1)
    return 40 * torch.rand(batch, *model.shape, generator=draw) - 20, torch.rand(batch, *region.shape, generator=draw)


def step(phase, target, region, loss=intensity_l2, model=MODEL):
    light = PhasePropagation(model, region, phase)
    return light.weigh(loss, target), light.phase_gradient()


@pytest.fixture
def hide(monkeypatch):
    """Hides what is compiled, as on a machine without Numba."""
    return lambda: monkeypatch.setattr(compiled, "AVAILABLE", False)


@pytest.mark.parametrize("region", REGIONS, ids=str)
@pytest.mark.parametrize("loss", list(LOSSES)[:4])
def test_a_step_without_numba_is_the_same_but_for_rounding(loss, region, hide):
    phase, target = pair(region)
    before = phase.clone()
    fast = step(phase, target, region, LOSSES[loss])
    assert torch.equal(phase, before)
    hide()
    slow = step(phase, target, region, LOSSES[loss])
    assert torch.allclose(fast[0], slow[0], rtol=1e-6)
    assert (fast[1] - slow[1]).norm() < 2e-6 * slow[1].norm()


def test_single_precision_gives_the_gradient_of_double_precision():
    region = REGIONS[1]
    phase, target = pair(region)
    double = AngularSpectrum(MODEL.shape, MODEL.pitch, MODEL.wavelength, MODEL.distance, dtype=torch.complex128)
    loss, gradient = step(phase, target, region)
    exact, expected = step(phase.double(), target.double(), region, model=double)
    assert torch.allclose(loss.double(), exact, rtol=1e-5)
    assert (gradient - expected).norm() < 1e-5 * expected.norm()


def test_a_step_is_the_same_for_any_number_of_threads():
    model = AngularSpectrum((600, 800), pitch=6.4e-6, wavelength=517e-9, distance=3e-3)
    region, before = Region(50, 60, 500, 700), torch.get_num_threads()
    phase, target = pair(region, batch=1, model=model)
    try:
        steps = []
        for threads in (1, 3):
            torch.set_num_threads(threads)
            steps.append(step(phase, target, region, model=model))
    finally:
        torch.set_num_threads(before)
    for one, other in zip(*steps, strict=True):
        assert torch.equal(one, other)


def test_arrays_that_are_views_give_the_same():
    phase, target = pair(REGIONS[1])
    contiguous = step(phase, target, REGIONS[1])
    views = step(phase.mT.contiguous().mT, target.mT.contiguous().mT, REGIONS[1])
    assert torch.allclose(contiguous[0], views[0])
    assert (contiguous[1] - views[1]).norm() < 2e-6 * contiguous[1].norm()


def test_a_black_target_gives_no_gradient():
    phase, target = pair(REGIONS[1])
    loss, gradient = step(phase, torch.zeros_like(target), REGIONS[1])
    assert loss.eq(0).all()
    assert gradient.eq(0).all()


def test_a_target_of_another_size_than_the_region_is_refused():
    phase, target = pair(REGIONS[1])
    with pytest.raises(RuntimeError, match="size"):
        step(phase, target[:, 1:], REGIONS[1])


def test_a_phase_that_could_have_a_gradient_has_none_here():
    phase, target = pair(REGIONS[1])
    with torch.no_grad():
        loss, gradient = step(phase.clone().requires_grad_(), target, REGIONS[1])
    for one, other in zip((loss, gradient), step(phase, target, REGIONS[1]), strict=True):
        assert torch.equal(one, other)


def gradients(steps: int, *shape: int) -> list[torch.Tensor]:
    draw = torch.Generator().manual_seed(1)
    some = torch.rand(shape, generator=draw) > 0.1  # a pixel without a gradient stays
    return [some * torch.randn(shape, generator=draw) * (0.1 + step % 3) for step in range(steps)]


@pytest.mark.parametrize("with_numba", [True, False])
def test_steps_are_those_of_torch(with_numba, monkeypatch):
    monkeypatch.setattr(compiled, "AVAILABLE", with_numba and compiled.AVAILABLE)
    phase, expected = torch.zeros(2, 2, 30, 41)
    ours, theirs = Adam(phase, 0.1), torch.optim.Adam([expected], eps=1e-8 / (30 * 41))
    for step, gradient in enumerate(gradients(30, 2, 30, 41)):
        rate = 0.1 / (1 + step)
        expected.grad, theirs.param_groups[0]["lr"] = gradient.clone(), rate
        ours.set_rate(rate)
        ours.step(gradient)
        theirs.step()
    assert torch.allclose(phase, expected, atol=1e-6)
    assert phase.abs().max() > 0.1


def test_the_size_of_the_panel_changes_no_pixel_of_the_descent():
    small = torch.rand(1, 8, 8, generator=torch.Generator().manual_seed(2))

    def descend(start):
        return adam(start, by_autograd(lambda phase: (phase - 0.5).pow(4).mean((1, 2))), iterations=40, step=0.01)

    large = descend(small.repeat(1, 5, 5))
    assert torch.allclose(descend(small).repeat(1, 5, 5), large, atol=1e-6)


@pytest.mark.parametrize("with_numba", [True, False])
def test_the_layout_of_arrays_in_memory_changes_nothing(with_numba, monkeypatch):
    monkeypatch.setattr(compiled, "AVAILABLE", with_numba and compiled.AVAILABLE)
    start, goal = torch.rand(2, 1, 12, 20, generator=torch.Generator().manual_seed(2))

    def turned(phase):  # its gradient lies column by column
        return ((phase.mT.contiguous() - goal.mT).square()).mean((1, 2))

    def plain(phase):
        return (phase - goal).square().mean((1, 2))

    found = [adam(start, by_autograd(loss), iterations=20, step=0.05) for loss in (plain, turned)]
    by_columns = adam(start.mT.contiguous().mT, by_autograd(plain), iterations=20, step=0.05)
    assert torch.allclose(found[0], found[1], atol=1e-6)
    assert torch.allclose(found[0], by_columns, atol=1e-6)


def test_autograd_and_the_written_out_gradient_take_the_same_path(bench, scene):
    def by_graph(image, channel):
        model, region = nominal_model(bench, channel, image), bench.spec.region

        def loss(phase):
            return amplitude_l2(region.crop(model.forward(unit_field(phase))).abs().square(), image)

        return adam(initial_phase("narrow", image, bench, channel), by_autograd(loss), iterations=8, step=0.1)

    target = scene(dtype=torch.float64)
    found = AmplitudeSGD(iterations=8, step=0.1, initial_phase="narrow", offset="none").solve(target, bench)
    assert torch.allclose(found, per_channel(target, by_graph), atol=1e-8)


TAU = 2 * torch.pi


@given(st.floats(-10, 10), st.floats(0.5, 5.0))
@settings(max_examples=40, deadline=None)
def test_centring_takes_any_gap_to_the_wrap_edge(shift, width):
    draw = torch.rand(64, 64, generator=torch.Generator().manual_seed(2))
    phase = with_offset(width * draw + shift, "centre")
    wrapped = torch.remainder(phase, TAU)
    assert wrapped.max() - wrapped.min() == pytest.approx(width, abs=0.02)
    margin = (TAU - width) / 2
    assert wrapped.min() > 0.5 * margin - 0.2


def test_centring_treats_every_panel_on_its_own():
    phase = torch.rand(2, 3, 32, 32, generator=torch.Generator().manual_seed(2))
    phase[1] += 2
    together = with_offset(phase, "centre")
    assert torch.equal(together[1, 2], with_offset(phase[1, 2], "centre"))


def test_the_offset_leaves_the_ideal_image(bench, scene):
    target = scene(dtype=torch.float64)
    plain, centred = (Wirtinger(iterations=10, offset=o).solve(target, bench)[:, 0] for o in ("none", "centre"))
    model = bench.spec.propagator(0, dtype=torch.complex128)
    images = [model.forward(torch.polar(torch.ones_like(p), p)).abs().square() for p in (plain, centred)]
    assert torch.allclose(images[0], images[1], atol=1e-10)
    assert (centred - plain).std() < 1e-10
    assert (centred - plain).abs().mean() > 0.1


def test_a_random_start_is_shared_by_the_batch_and_differs_between_colours_and_cells(bench, scene):
    target = scene(batch=2)[:, 0]
    red, green = (initial_phase("random", target, bench, channel) for channel in (0, 1))
    assert torch.equal(red[0], red[1])
    assert not torch.equal(red, green)
    assert red.min() >= 0
    assert TAU * 0.99 < red.max() <= TAU
    bench.cell = "another cell"
    assert not torch.equal(initial_phase("random", target, bench, 0), red)


def test_a_narrow_start_spans_one_radian_and_a_constant_or_lensless_one_is_even(bench, make_bench, scene):
    phase = initial_phase("narrow", scene()[:, 0], bench, 0)
    assert 0.9 < float(phase.max() - phase.min()) <= 1
    phase = initial_phase("constant", scene(batch=2)[:, 0], bench, 0)
    phase[0] += 1  # image by image
    assert phase[1].eq(0).all()
    whole = make_bench(size=48, region=48)  # a region as large as the panel needs no lens
    object.__setattr__(whole.spec.region, "left", 0)
    assert initial_phase("quadratic", scene(size=48)[:, 0], whole, 0).eq(0).all()


def test_the_quadratic_start_gathers_the_light_in_the_region(make_bench, scene):
    bench = make_bench(size=96, region=64, distance=20e-3)
    target = scene(size=64)[:, 0]
    light = {}
    for kind in ("constant", "quadratic"):
        phase = initial_phase(kind, target, bench, 1)
        image = bench.spec.propagator(1).forward(torch.polar(torch.ones_like(phase), phase)).abs().square()
        light[kind] = float(bench.spec.region.crop(image).sum() / phase.numel())
    assert light["quadratic"] > 0.85
    assert light["quadratic"] > light["constant"] + 0.2
