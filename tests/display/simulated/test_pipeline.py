"""The stages together, compiled and in torch: the nominal model when nothing is wrong, repeatable when much is."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from holobench_eval.core import compiled
from holobench_eval.display import load_profile
from holobench_eval.display.simulated import kernels, stages
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.display.simulated.profile import names
from holobench_eval.display.simulated.stages.relay import sample
from holobench_eval.display.simulated.stages.sensor import box_filter
from holobench_eval.optics import blocks, quantise

PANEL = (96, 128)


def field_of(spec, phase, channel=1):
    return spec.propagator(channel).forward(torch.polar(torch.ones(spec.shape), quantise(phase, spec.bits)))


def test_ideal_bench_is_the_nominal_model(ideal, phase):
    bench = SimulatedBench(ideal)
    right = field_of(bench.spec, phase[1]).abs().square()
    found = bench.intensity(phase[1], 1)
    assert float((found - right).norm() / right.norm()) < 2e-3


def test_finer_sampling_changes_nothing_without_sub_pixel_effects(with_stage, phase):
    coarse = SimulatedBench(with_stage(sampling=1)).intensity(phase[1], 1)
    fine = SimulatedBench(with_stage(sampling=3)).intensity(phase[1], 1)[::2, ::2]
    assert float((fine - coarse).norm() / coarse.norm()) < 0.08  # nine points a pixel instead of one


def test_full_pixels_roll_off_like_a_sinc(with_stage):
    """A grating near the band's edge loses the light that a square pixel's diffraction takes."""
    columns = torch.arange(PANEL[1], dtype=torch.float32)
    grating = (2 * torch.pi * 0.3 * columns).expand(3, *PANEL)
    ideal = SimulatedBench(with_stage()).intensity(grating[1], 1)
    held = SimulatedBench(with_stage(sampling=1, aperture=stages.PixelAperture())).intensity(grating[1], 1)
    share = float(held.sum() / ideal.sum())
    assert share == pytest.approx(float(torch.sinc(torch.tensor(0.3)) ** 2), rel=0.02)


def test_blazed_light_is_that_of_a_square_pixel_at_its_angle(with_stage):
    """A flat phase with a blaze leaves at the carrier, where a full pixel sends sinc^2 of its light."""
    flat = torch.zeros(PANEL)
    panel = replace(with_stage().panel, blaze=(0.0, 0.25), pupil=0.4)
    straight = SimulatedBench(with_stage(panel=replace(panel, blaze=(0.0, 0.0)))).intensity(flat, 1).mean()
    for sampling in (1, 3, 5):
        bench = SimulatedBench(with_stage(panel=panel, sampling=sampling, aperture=stages.PixelAperture()))
        share = float(bench.intensity(flat, 1).mean() / straight)
        assert share == pytest.approx(float(torch.sinc(torch.tensor(0.25)) ** 2), rel=0.02)


def test_unmodulated_light_is_there_under_any_phase_unless_an_iris_off_axis_stops_it(with_stage, phase):
    bench = SimulatedBench(with_stage(zero_order=stages.ZeroOrder(0.999)))
    assert float(bench.intensity(phase[1], 1).mean()) == pytest.approx(1, abs=0.1)
    profile, flat = load_profile("pluto-offaxis").scaled(PANEL), torch.zeros(PANEL)
    only_zero = replace(profile, zero_order=stages.ZeroOrder(0.999))
    assert float(SimulatedBench(only_zero).intensity(flat, 1).mean()) < 0.01
    assert float(SimulatedBench(profile).intensity(flat, 1).mean()) > 0.2


def test_blaze_leaves_the_image_where_it_was(with_stage, phase):
    panel = replace(with_stage().panel, pupil=0.4)
    profiles = (with_stage(panel=panel), with_stage(panel=replace(panel, blaze=(0.0, 0.25))))
    a, b = (SimulatedBench(profile).intensity(phase[1] / 8, 1) for profile in profiles)
    assert float((a - b).norm() / a.norm()) < 0.02


@pytest.mark.parametrize("name", names())
def test_light_is_neither_made_nor_lost(name, phase):
    """Mean light in the panel's shadow; an iris beside the zero order passes least, and some light spreads further."""
    off_axis = ("pluto-offaxis", "leto-2020", "leto-hazy", "leto-hazy-b", "leto-hazy-c")
    least = 0.75 if name in ("ideal", "plm-4bit") else 0.15 if name in off_axis else 0.4
    bench = SimulatedBench(load_profile(name).scaled(PANEL))
    assert least < float(bench.image(phase[: len(bench.channels)]).mean()) < 1.02


def test_defocus_of_the_bench_is_that_of_the_nominal_model(with_stage, phase):
    bench = SimulatedBench(with_stage(propagation=stages.Propagation(distance_error=0.1)))
    moved = replace(bench.spec, distance=bench.spec.distance * 1.1)
    right = field_of(moved, phase[1]).abs().square()
    assert float((bench.intensity(phase[1], 1) - right).norm() / right.norm()) < 1e-2


def test_a_ripple_adds_the_light_of_its_moments(with_stage, phase):
    bench, still = SimulatedBench(with_stage(flicker=stages.Flicker(ripple=0.1))), SimulatedBench(with_stage())
    moments = [still.intensity(phase[1], 1, gain) for gain in (0.9, 1.1)]
    assert torch.allclose(bench.intensity(phase[1], 1), (moments[0] + moments[1]) / 2, atol=1e-5)


def test_an_uneven_table_is_shown_with_and_without_a_gradient(with_stage, phase):
    bench, even = SimulatedBench(with_stage(lut=stages.LookUpTable(bend=0.05))), SimulatedBench(with_stage())
    light = bench.intensity(phase[1], 1)
    slow = bench.intensity(phase[1].clone().requires_grad_(), 1).detach()
    assert float((light - slow).norm() / slow.norm()) < 1e-6
    assert float((light - even.intensity(phase[1], 1)).norm() / light.norm()) > 0.05


def test_noise_depends_on_names_and_frame_not_on_what_is_shown(phase):
    bench = SimulatedBench(load_profile("leto-aged").scaled(PANEL))
    exposure = (2000.0, 2000.0, 2000.0)

    def frames(*names):
        session = bench.session(*names, exposure=exposure)
        return [session.capture(phase).frame for _ in range(2)]

    first, again, other = frames("a", 0), frames("a", 0), frames("a", 1)
    assert torch.equal(first[0], again[0])
    assert torch.equal(first[1], again[1])
    assert not torch.equal(first[0], first[1])
    assert not torch.equal(first[0], other[0])


def test_frames_share_the_light_and_the_noise_of_one_exposure(with_stage, phase):
    frames = torch.stack([phase, phase.roll(7, -1), -phase])
    noise = stages.Sensor(bits=12, full_well=20000, read_noise=40.0)
    quiet, noisy = (SimulatedBench(with_stage(sensor=sensor)) for sensor in (replace(noise, read_noise=0.0), noise))

    def capture(bench, shown, exposure=3000.0):
        return bench.session("frames", exposure=(exposure,) * 3).capture(shown).frame

    assert torch.equal(capture(noisy, frames[:1]), capture(noisy, phase))
    together, alone = capture(quiet, frames), torch.stack([capture(quiet, frame) for frame in frames]).mean(0)
    assert float((together - alone).abs().mean() / alone.mean()) < 0.03
    spread = [capture(noisy, shown, 1e-3).std() for shown in (phase, frames)]
    assert float(spread[1] / spread[0]) == pytest.approx(1, abs=0.1)  # three exposures would have 1 / sqrt(3)


def test_speckle_of_frames_falls_with_the_root_of_their_number(with_stage):
    """As of independent intensities (Goodman, Speckle Phenomena in Optics, 2007, Section 3.1)."""
    bench = SimulatedBench(with_stage(sensor=stages.Sensor(bits=16, full_well=1e6, read_noise=0.0)))
    phases = 2 * torch.pi * torch.rand(16, 3, *PANEL, generator=torch.Generator().manual_seed(3))

    def contrast(count):
        light = bench.session("speckle", exposure=(3e4,) * 3).capture(phases[:count]).linear()[1]
        middle = light[light.shape[0] // 4 : -light.shape[0] // 4, light.shape[1] // 4 : -light.shape[1] // 4]
        return float(middle.std() / middle.mean())

    assert [contrast(count) / contrast(1) for count in (4, 16)] == pytest.approx([0.5, 0.25], rel=0.1)


@pytest.mark.parametrize("noise", [True, False])
def test_a_capture_carries_no_gradient(with_stage, phase, noise):
    bench = SimulatedBench(with_stage(sensor=stages.Sensor(noise=noise)))
    shown = phase.clone().requires_grad_()
    assert not bench.session("names", exposure=(100.0,) * 3).capture(shown).frame.requires_grad
    assert bench.image(shown).requires_grad  # what the oracle alone may differentiate


def test_days_change_the_bench_and_zero_days_do_not(phase):
    profile = load_profile("leto-aged").scaled(PANEL)
    today = SimulatedBench(profile).intensity(phase[1], 1)
    still = SimulatedBench(replace(profile, drift=replace(profile.drift, days=0.0))).intensity(phase[1], 1)
    later = SimulatedBench(replace(profile, drift=stages.Drift(days=90, gain=0.01, tilt=0.05))).intensity(phase[1], 1)
    assert torch.equal(today, still)
    assert not torch.allclose(today, later, rtol=1e-3)


@pytest.mark.parametrize("grad", [True, False])
def test_a_phase_of_another_size_than_the_panel_is_refused_and_the_first_capture_may_be_in_inference_mode(grad):
    profile = load_profile("leto-mild").scaled((64, 96))
    with torch.inference_mode():
        bench = SimulatedBench(profile)
        light = bench.intensity(torch.zeros(64, 96), 1)
    assert torch.equal(light, SimulatedBench(profile).intensity(torch.zeros(64, 96), 1))
    for shape in ((63, 96), (64, 97), (2, 64, 96)):
        with torch.set_grad_enabled(grad), pytest.raises(ValueError, match="the panel is"):
            bench.intensity(torch.zeros(shape, requires_grad=grad), channel=0)


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


@pytest.mark.parametrize(("width", "size"), [(1.16, 2**30), (4.0, 1000)])
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
