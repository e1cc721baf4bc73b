from dataclasses import replace

import pytest
import torch

from holobench_eval.core.errors import BudgetError, CellError
from holobench_eval.display import CalibratedBench, Profile, load_profile
from holobench_eval.display.api import white_irradiance
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.imaging import Registration
from holobench_eval.study.opening import open_bench
from holobench_eval.testing.propagation_reference import gaussian_beam

PANEL = (192, 192)


class Camera:
    camera = True


class Privileged:
    privileged = True


@pytest.fixture(scope="module")
def bench():
    return open_bench(load_profile("ideal"), PANEL, seed=3)


@pytest.fixture
def target(bench):
    return gaussian_beam(bench.spec.region.shape, 300e-6).abs().float().expand(3, -1, -1)


def test_method_without_camera_may_not_capture(bench, target):
    handle = bench.for_method(object(), "blind", target, "t", 0)
    with pytest.raises(CellError, match="blind took a capture"):
        handle.capture(torch.zeros(3, *PANEL))
    assert handle.captures == 0


def test_captures_are_counted_and_stop_at_the_budget(bench, target):
    handle = bench.for_method(Camera(), "camera", target, "t", 0, budget=2)
    image = handle.rectify(handle.capture(torch.zeros(3, *PANEL)))
    assert image.shape == target.shape
    handle.capture(torch.zeros(3, *PANEL))
    with pytest.raises(BudgetError, match="used its 2 captures"):
        handle.capture(torch.zeros(3, *PANEL))
    assert handle.captures == 2


def test_only_frames_that_were_captured_are_rectified(bench, target):
    handle = bench.for_method(Camera(), "camera", target, "t", 0)
    capture = handle.capture(torch.zeros(3, *PANEL))
    for forged in (replace(capture, frame=capture.frame + 1), replace(capture, dark=capture.dark - 1)):
        with pytest.raises(CellError, match="camera: rectify takes a frame as capture returned it"):
            handle.rectify(forged)
    assert handle.rectify(replace(capture)).shape == target.shape
    assert handle.captures == 1


def test_only_privileged_methods_see_the_simulation(bench, target):
    assert bench.for_method(Privileged(), "oracle", target, "t", 0).simulation.bench is bench.bench
    with pytest.raises(CellError, match="privileged"):
        _ = bench.for_method(Camera(), "camera", target, "t", 0).simulation


def test_method_cannot_reach_the_scored_target_or_its_own_account(bench, target):
    handle = bench.for_method(Camera(), "m", target, "t", 0)
    handle._target.zero_()
    assert float(target.max()) > 0.5
    for name in ("captures", "spec", "simulation"):
        with pytest.raises(AttributeError):
            setattr(handle, name, 0)


def test_random_numbers_depend_on_target_repeat_and_name(bench, target):
    def draw(item, repeat, name):
        return torch.rand(3, generator=bench.for_method(object(), "m", target, item, repeat).generator(name)).tolist()

    assert draw("a", 0, "x") == draw("a", 0, "x")
    assert len({tuple(draw(*names)) for names in (("a", 0, "x"), ("b", 0, "x"), ("a", 1, "x"), ("a", 0, "y"))}) == 4


def test_efficiency_counts_the_light_in_the_region(bench, target):
    """A flat phase sends the light straight through: the region gets its share of the panel."""
    shot = bench.photograph(torch.zeros(3, *PANEL), target, "t", 0)
    with pytest.raises(CellError, match="mine: phase holds 110592 values that are NaN"):
        bench.photograph(torch.full((3, *PANEL), torch.nan), target, "t", 0, label="mine")
    region = bench.spec.region
    assert shot.efficiency == pytest.approx(region.height * region.width / (PANEL[0] * PANEL[1]), rel=0.05)
    assert shot.saturated == 0


def test_exposure_is_equal_for_all_methods_unless_brightness_is_matched(bench, target):
    first = bench.photograph(torch.zeros(3, *PANEL), target, "t", 0)
    bright = bench.photograph(torch.zeros(3, *PANEL), target, "t", 0, exposure="matched")
    assert first.exposure == bench.exposure(target)
    assert bright.exposure != first.exposure
    assert torch.allclose(bright.image, first.image, atol=0.05)


def test_a_handle_gives_the_nominal_optics_and_nothing_of_the_bench(bench, target):
    handle = bench.for_method(object(), "m", target, "t", 0)
    assert handle.spec is bench.spec
    assert torch.isfinite(white_irradiance(torch.zeros(3, 8, 8), bench.spec)).all()  # of a dark target too
    assert torch.equal(handle.light, white_irradiance(target, bench.spec))
    refused, hidden = set(), (CalibratedBench, SimulatedBench, Profile, Registration)
    for name in (name for name in dir(handle) if not name.startswith("_")):
        try:
            assert not isinstance(getattr(handle, name), hidden), name
        except CellError:
            refused.add(name)
    assert refused == {"simulation", "learned", "starts"}


def test_simulation_is_the_mean_capture_in_the_target_frame_and_tells_its_noise(target):
    aged = open_bench(load_profile("leto-aged"), PANEL)
    flat = torch.zeros(3, *PANEL)
    simulated, variance = aged.simulation.expected(flat, target)
    captured = aged.photograph(flat, target, "t", 0).image
    assert float((simulated - captured).norm() / captured.norm()) < 0.03
    assert float((simulated - captured).square().sum()) == pytest.approx(float(variance.sum()), rel=0.05)
