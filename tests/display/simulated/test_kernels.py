"""Compiled passes give what torch gives, and what they read lies in their arrays whatever the input."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from holobench_eval.core import compiled
from holobench_eval.display import load_profile
from holobench_eval.display.simulated import kernels
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.display.simulated.profile import names
from holobench_eval.display.simulated.stages.relay import sample
from holobench_eval.display.simulated.stages.sensor import box_filter
from holobench_eval.optics import blocks

PANEL = (96, 128)


@pytest.fixture
def hide(monkeypatch):
    """Hides what is compiled, as on a machine without Numba."""
    return lambda: monkeypatch.setattr(compiled, "AVAILABLE", False)


@pytest.mark.parametrize("name", [*names(), "uneven"])
def test_light_of_the_panel_and_its_gradient_are_those_of_torch(name, phase):
    profile = load_profile("leto-aged" if name == "uneven" else name).scaled(PANEL)
    if name == "uneven":
        profile = replace(profile, crosstalk=replace(profile.crosstalk, ratio=0.6))
    bench = SimulatedBench(profile)
    for channel, maps in enumerate(bench.channels):
        given = (40 * phase[channel] - 100).requires_grad_()  # wrapped many times, to both sides
        fast, slow = maps.light.field(given, 1.02), maps.light.in_torch(given, 1.02)
        slope = torch.randn(slow.shape, dtype=slow.dtype, generator=torch.Generator().manual_seed(4))
        grads = [torch.autograd.grad(light, given, slope)[0] for light in (fast, slow)]
        assert float((fast - slow).detach().norm() / slow.detach().norm()) < 1e-6
        assert float((grads[0] - grads[1]).norm() / grads[1].norm()) < 2e-6


@pytest.mark.parametrize("name", ["leto-aged", "ideal"])
def test_light_and_gradient_do_not_depend_on_the_blocks_of_rows(name, phase, monkeypatch):
    light = SimulatedBench(load_profile(name).scaled(PANEL)).channels[1].light
    given, found = phase[1].clone().requires_grad_(), []
    for size in (2**30, 2**16):
        monkeypatch.setattr(blocks, "BLOCK_BYTES", size)
        field = light.field(given, 1.0)
        found.append((field.detach(), *torch.autograd.grad(field.real.sum(), given)))
    assert all(torch.equal(*pair) for pair in zip(*found, strict=True))
    assert torch.equal(light.rows(given.detach(), 1.0)(slice(32, 80)), found[0][0][:, :, 32:80])


def test_a_phase_that_is_no_number_stays_none(phase):
    light = SimulatedBench(load_profile("leto-aged").scaled(PANEL)).channels[1].light
    given = phase[1].clone()
    given[40, 50], given[41, 60] = float("nan"), float("inf")
    field = light.field(given, 1.0)
    assert bool(field[:, :, 40, 50].isnan().all())
    assert bool(field[:, :, 41, 60].isnan().all())
    assert bool(field[:, :, 60:].isfinite().all())


@pytest.mark.parametrize("name", ["leto-aged", "pluto-offaxis"])
def test_intensity_without_a_gradient_is_that_with_one(name, phase):
    bench = SimulatedBench(load_profile(name).scaled(PANEL))
    fast = bench.integrated(phase[1], 1)
    slow = bench.integrated(phase[1].clone().requires_grad_(), 1).detach()
    assert float((fast - slow).norm() / slow.norm()) < 1e-6


@pytest.mark.parametrize("width", [1.16, 4.0])
@pytest.mark.parametrize("size", [2**30, 1000])
def test_the_area_of_a_pixel_and_its_gradient_are_those_of_torch(width, size, monkeypatch):
    monkeypatch.setattr(blocks, "BLOCK_BYTES", size)
    image, slope = torch.rand(2, 41, 58, generator=torch.Generator().manual_seed(5))
    image.requires_grad_()
    fast, slow = box_filter(image, width), box_filter(image[None], width)[0]  # compiled for one picture
    assert torch.allclose(fast, slow, rtol=1e-6)
    assert torch.allclose(*(torch.autograd.grad(light, image, slope)[0] for light in (fast, slow)), rtol=2e-6)


@pytest.mark.parametrize("per_pixel", [1, 2])
def test_sampling_equals_that_of_torch_inside_at_the_edge_and_outside(per_pixel, hide):
    draw = torch.Generator().manual_seed(3)
    image = torch.rand(40 * per_pixel, 60 * per_pixel, generator=draw)
    grid = 2.4 * torch.rand(50, 70, 2, generator=draw) - 1.2
    grid[0, :3] = torch.tensor([[-1.0, -1.0], [1.0, 1.0], [1e30, -1e30]])
    fast = sample(image, grid, per_pixel)
    hide()
    assert torch.allclose(fast, sample(image, grid, per_pixel), atol=2e-6)


def test_a_place_that_is_no_number_gives_none_and_reads_nothing_beyond_the_image():
    grid = torch.zeros(2, 3, 2)
    grid[0] = float("nan")  # as an index it would lie far outside
    seen = sample(torch.ones(8, 8), grid, 1)
    assert bool(seen[0].isnan().all())
    assert bool((seen[1] == 1).all())


def test_a_capture_without_numba_is_the_same_but_for_rounding(phase, hide):
    profile = load_profile("leto-aged").scaled(PANEL)
    bench, names = SimulatedBench(profile), ("test", 0)
    fast = bench.session(*names, exposure=(4000.0,) * 3).capture(phase).frame
    hide()
    slow = bench.session(*names, exposure=(4000.0,) * 3).capture(phase).frame
    assert float((fast - slow).abs().max()) <= 1  # a count is a whole number
    assert float((fast != slow).float().mean()) < 1e-2


def test_the_logarithm_has_the_accuracy_that_it_states():
    numbers = np.geomspace(2**-25, 1, 100_001).astype(np.float32)[::20]
    logs = np.log(numbers.astype(float))
    found = np.array([kernels.log(number) for number in numbers])
    assert (np.abs(found - logs) / np.maximum(1, np.abs(logs))).max() < 1e-7
