"""Compiled passes give what torch gives, and what they read lies in their arrays whatever the input."""

import numpy as np
import pytest
import torch

from holobench_eval.core import compiled
from holobench_eval.display import load_profile
from holobench_eval.display.simulated import kernels
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.display.simulated.profile import names
from holobench_eval.display.simulated.stages.relay import sample

PANEL = (96, 128)


@pytest.fixture
def hide(monkeypatch):
    """Hides what is compiled, as on a machine without Numba."""
    return lambda: monkeypatch.setattr(compiled, "AVAILABLE", False)


@pytest.mark.parametrize("name", names())
def test_light_of_the_panel_is_that_of_the_differentiable_form(name, phase):
    bench = SimulatedBench(load_profile(name).scaled(PANEL))
    for channel, maps in enumerate(bench.channels):
        given = 40 * phase[channel] - 100  # wrapped many times, to both sides
        fast = bench._modulated_field(given, maps, 1.02)
        slow = bench._modulated_field(given.clone().requires_grad_(), maps, 1.02).detach()
        assert float((fast - slow).norm() / slow.norm()) < 1e-6


def test_a_phase_that_is_no_number_stays_none(phase):
    bench = SimulatedBench(load_profile("leto-aged").scaled(PANEL))
    given = phase[1].clone()
    given[40, 50], given[41, 60] = float("nan"), float("inf")
    field = bench._modulated_field(given, bench.channels[1], 1.0)
    assert bool(field[:, :, 40, 50].isnan().all())
    assert bool(field[:, :, 41, 60].isnan().all())
    assert bool(field[:, :, 60:].isfinite().all())


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
