import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from holobench_eval.methods.common import with_offset
from holobench_eval.methods.initial_phase import initial_phase
from holobench_eval.methods.wirtinger import Wirtinger

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


def test_centring_treats_every_panel_on_its_own(bench, scene):
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


def test_a_narrow_start_spans_one_radian_and_a_constant_one_can_be_changed_image_by_image(bench, scene):
    phase = initial_phase("narrow", scene()[:, 0], bench, 0)
    assert 0.9 < float(phase.max() - phase.min()) <= 1
    phase = initial_phase("constant", scene(batch=2)[:, 0], bench, 0)
    phase[0] += 1
    assert phase[1].eq(0).all()


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


def test_a_region_as_large_as_the_panel_needs_no_lens(make_bench, scene):
    bench = make_bench(size=48, region=48)
    object.__setattr__(bench.spec.region, "left", 0)
    phase = initial_phase("quadratic", scene(size=48)[:, 0], bench, 0)
    assert phase.eq(0).all()
