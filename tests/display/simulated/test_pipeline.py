"""The stages together: a bench that is the nominal model when nothing is wrong, and repeatable when much is."""

from dataclasses import replace

import pytest
import torch

from holobench_eval.display import load_profile
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.display.simulated.profile import names
from holobench_eval.display.simulated.stages import (
    Drift,
    Flicker,
    LookUpTable,
    PixelAperture,
    Propagation,
    Sensor,
    ZeroOrder,
)
from holobench_eval.optics import quantise

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
    held = SimulatedBench(with_stage(sampling=1, aperture=PixelAperture())).intensity(grating[1], 1)
    share = float(held.sum() / ideal.sum())
    assert share == pytest.approx(float(torch.sinc(torch.tensor(0.3)) ** 2), rel=0.02)


def test_blazed_light_is_that_of_a_square_pixel_at_its_angle(with_stage):
    """A flat phase with a blaze leaves at the carrier, where a full pixel sends sinc^2 of its light."""
    flat = torch.zeros(PANEL)
    panel = replace(with_stage().panel, blaze=(0.0, 0.25), pupil=0.4)
    straight = SimulatedBench(with_stage(panel=replace(panel, blaze=(0.0, 0.0)))).intensity(flat, 1).mean()
    for sampling in (1, 3, 5):
        bench = SimulatedBench(with_stage(panel=panel, sampling=sampling, aperture=PixelAperture()))
        share = float(bench.intensity(flat, 1).mean() / straight)
        assert share == pytest.approx(float(torch.sinc(torch.tensor(0.25)) ** 2), rel=0.02)


def test_unmodulated_light_is_there_under_any_phase_unless_an_iris_off_axis_stops_it(with_stage, phase):
    bench = SimulatedBench(with_stage(zero_order=ZeroOrder(0.999)))
    assert float(bench.intensity(phase[1], 1).mean()) == pytest.approx(1, abs=0.1)
    profile, flat = load_profile("pluto-offaxis").scaled(PANEL), torch.zeros(PANEL)
    only_zero = replace(profile, zero_order=ZeroOrder(0.999))
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
    bench = SimulatedBench(with_stage(propagation=Propagation(distance_error=0.1)))
    moved = replace(bench.spec, distance=bench.spec.distance * 1.1)
    right = field_of(moved, phase[1]).abs().square()
    assert float((bench.intensity(phase[1], 1) - right).norm() / right.norm()) < 1e-2


def test_a_ripple_adds_the_light_of_its_moments(with_stage, phase):
    bench, still = SimulatedBench(with_stage(flicker=Flicker(ripple=0.1))), SimulatedBench(with_stage())
    moments = [still.intensity(phase[1], 1, gain) for gain in (0.9, 1.1)]
    assert torch.allclose(bench.intensity(phase[1], 1), (moments[0] + moments[1]) / 2, atol=1e-5)


def test_an_uneven_table_is_shown_with_and_without_a_gradient(with_stage, phase):
    bench, even = SimulatedBench(with_stage(lut=LookUpTable(bend=0.05))), SimulatedBench(with_stage())
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
    noise = Sensor(bits=12, full_well=20000, read_noise=40.0)
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
    bench = SimulatedBench(with_stage(sensor=Sensor(bits=16, full_well=1e6, read_noise=0.0)))
    phases = 2 * torch.pi * torch.rand(16, 3, *PANEL, generator=torch.Generator().manual_seed(3))

    def contrast(count):
        light = bench.session("speckle", exposure=(3e4,) * 3).capture(phases[:count]).linear()[1]
        middle = light[light.shape[0] // 4 : -light.shape[0] // 4, light.shape[1] // 4 : -light.shape[1] // 4]
        return float(middle.std() / middle.mean())

    assert [contrast(count) / contrast(1) for count in (4, 16)] == pytest.approx([0.5, 0.25], rel=0.1)


@pytest.mark.parametrize("noise", [True, False])
def test_a_capture_carries_no_gradient(with_stage, phase, noise):
    bench = SimulatedBench(with_stage(sensor=Sensor(noise=noise)))
    shown = phase.clone().requires_grad_()
    assert not bench.session("names", exposure=(100.0,) * 3).capture(shown).frame.requires_grad
    assert bench.image(shown).requires_grad  # what the oracle alone may differentiate


def test_days_change_the_bench_and_zero_days_do_not(phase):
    profile = load_profile("leto-aged").scaled(PANEL)
    today = SimulatedBench(profile).intensity(phase[1], 1)
    still = SimulatedBench(replace(profile, drift=replace(profile.drift, days=0.0))).intensity(phase[1], 1)
    later = SimulatedBench(replace(profile, drift=Drift(days=90, gain=0.01, tilt=0.05))).intensity(phase[1], 1)
    assert torch.equal(today, still)
    assert not torch.allclose(today, later, rtol=1e-3)


@pytest.mark.parametrize("grad", [True, False])
def test_a_phase_of_another_size_than_the_panel_is_refused(grad):
    bench = SimulatedBench(load_profile("leto-mild").scaled((64, 64)))
    for shape in ((63, 64), (64, 65), (2, 64, 64)):
        with torch.set_grad_enabled(grad), pytest.raises(ValueError, match="the panel is"):
            bench.intensity(torch.zeros(shape, requires_grad=grad), channel=0)


def test_the_first_capture_of_a_process_may_be_in_inference_mode():
    profile = load_profile("leto-mild").scaled((64, 96))
    with torch.inference_mode():
        light = SimulatedBench(profile).intensity(torch.zeros(64, 96), 1)
    assert torch.equal(light, SimulatedBench(profile).intensity(torch.zeros(64, 96), 1))
