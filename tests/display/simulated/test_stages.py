"""Every stage alone: what it does to the light, in numbers that can be checked by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from holobench_eval.core import compiled
from holobench_eval.display import load_profile
from holobench_eval.display.simulated import stages
from holobench_eval.display.simulated.kernels import philox
from holobench_eval.display.simulated.noise import normal
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.display.simulated.stages.panel import straight_through_level
from holobench_eval.display.simulated.stages.relay import sample, sampling_grid
from holobench_eval.display.simulated.stages.sensor import box_filter

TAU = 2 * math.pi


def test_level_is_whole_and_its_gradient_is_that_of_the_phase():
    phase = torch.tensor([0.1, 3.0, 6.2], requires_grad=True)
    level = straight_through_level(phase, 8)
    level.sum().backward()
    assert torch.equal(level.detach(), level.detach().round())
    assert torch.allclose(phase.grad, torch.full((3,), 256 / TAU))


def test_linear_table_gives_the_nominal_phase(geometry):
    table = stages.LookUpTable()
    level = torch.arange(256.0).view(1, -1)
    assert torch.allclose(table.phase(level, 8, torch.ones(1), 0), level / 256 * TAU, atol=1e-4)
    assert torch.allclose(table.gain_map(geometry), torch.ones(geometry.shape))


def test_a_table_has_its_gamma_and_gain_or_its_published_percentages_and_no_other_length():
    bent = stages.LookUpTable(gamma=(1.2, 1.2, 1.2), gain=(0.9, 0.9, 0.9)).curve(8, 0)
    assert float(bent[128]) == pytest.approx(0.9 * TAU * 0.5**1.2, rel=1e-5)
    percent = (0.0, 10.0, 40.0, 100.0)
    curve = stages.LookUpTable(table=percent).curve(2, 0)
    assert torch.allclose(curve, torch.tensor(percent) / 100 * TAU * 3 / 4)
    with pytest.raises(ValueError, match="entries"):
        stages.LookUpTable(table=percent).curve(4, 0)


@settings(max_examples=20, deadline=None)
@given(st.floats(0, 1), st.integers(1, 5))
def test_crosstalk_keeps_a_constant_phase(width, samples):
    stage = stages.Crosstalk(width)
    phase = torch.full((12, 16), 2.5)
    assert torch.allclose(stage.apply(phase, stage.weights(samples)), torch.full((samples**2, 12, 16), 2.5), atol=1e-5)


def test_crosstalk_turns_a_wrap_edge_into_a_ramp_and_none_keeps_pixels_apart():
    phase, none = torch.rand(8, 8), stages.Crosstalk(0.0)
    assert torch.allclose(none.apply(phase, none.weights(3)), phase.expand(9, 8, 8), atol=1e-6)
    phase = torch.zeros(9, 16)
    phase[:, 8:] = TAU
    stage = stages.Crosstalk(0.45)
    row = stage.apply(phase, stage.weights(3)).reshape(3, 3, 9, 16)[1, :, 4].T.reshape(-1)
    assert torch.all(row.diff() >= -1e-6)
    inside = (row > 0.05 * TAU) & (row < 0.95 * TAU)
    assert 3 <= int(inside.sum()) <= 6


def test_uneven_crosstalk_is_that_of_each_width_along_its_axis():
    edge = torch.zeros(16, 16)
    edge[:, 8:] = TAU
    uneven, wide, narrow = stages.Crosstalk(0.3, ratio=2.0), stages.Crosstalk(0.6), stages.Crosstalk(0.3)
    along_rows = [stage.apply(edge, stage.weights(3))[:, 4:12, 4:12] for stage in (uneven, wide)]
    along_columns = [stage.apply(edge.T, stage.weights(3))[:, 4:12, 4:12] for stage in (uneven, narrow)]
    assert torch.allclose(*along_rows, atol=1e-3)
    assert torch.allclose(*along_columns, atol=1e-3)


def test_an_uneven_table_bends_as_much_as_stated_and_only_where_it_is_said(geometry):
    assert stages.LookUpTable().bend_map(geometry) is None
    table = stages.LookUpTable(gamma=(1.1, 1.1, 1.1), bend=0.05)
    bend = table.bend_map(geometry)
    assert float(bend.std()) == pytest.approx(0.05, rel=0.2)
    shown = table.phase(torch.full(geometry.shape, 64.0), 8, torch.ones(()), 0, bend)
    assert torch.allclose(shown, TAU * 0.25 ** (1.1 + bend), atol=1e-4)


@given(st.floats(0.1, 1.0), st.integers(1, 7))
def test_active_shares_add_up_to_the_fill_factor_and_dead_area_reflects_the_rest(fill, samples):
    assert float(stages.PixelAperture(fill).active_share(samples).mean()) == pytest.approx(fill, abs=1e-5)
    dead = stages.PixelAperture(fill, dead_amplitude=0.4).dead_share(samples)
    assert float(dead.mean()) == pytest.approx(0.4 * (1 - fill), abs=1e-5)


def test_flicker_and_the_ripple_within_a_frame_have_their_rms():
    draw = torch.Generator().manual_seed(0)
    gains = torch.tensor([stages.Flicker(0.05).gain(draw) for _ in range(2000)])
    assert float(gains.std()) == pytest.approx(0.05, rel=0.1)
    assert stages.Flicker().gain(draw) == 1.0
    assert stages.Flicker(0.05).moments == (1.0,)
    assert torch.tensor(stages.Flicker(ripple=0.03).moments).std(correction=0) == pytest.approx(0.03)


def test_illumination_has_unit_mean_power_and_the_stated_phase(geometry):
    light = stages.Illumination(beam_sigma=0.8, fringes=0.08, phase_rms=0.25).panel(geometry)
    assert float(light.abs().square().mean()) == pytest.approx(1, rel=1e-4)
    assert float(light.angle().square().mean().sqrt()) == pytest.approx(0.25, rel=1e-3)
    assert torch.allclose(stages.Illumination().panel(geometry), torch.ones(geometry.shape, dtype=torch.complex64))


def test_fringes_modulate_by_what_they_say(geometry):
    amplitude = stages.Illumination(fringes=0.08).panel(geometry).abs()
    assert 0.10 < float(amplitude.max() - amplitude.min()) <= 0.17


def test_dirt_only_absorbs_and_roughness_has_its_rms(geometry):
    dirty = stages.CoherentNoise(specks=20, scratches=2, plane_specks=5)
    panel, plane = dirty.panel(geometry).abs(), dirty.plane(geometry).abs()
    for transmission in (panel, plane):
        assert 0 <= float(transmission.min()) < 0.7
        assert float(transmission.max()) <= 1 + 1e-6
        assert float((transmission < 0.99).float().mean()) < 0.2
    assert stages.CoherentNoise().plane(geometry) is None
    rough = stages.CoherentNoise(roughness=0.1).panel(geometry).angle()
    assert float(rough.square().mean().sqrt()) == pytest.approx(0.1, rel=0.01)


def test_random_patterns_depend_on_the_bench_alone(geometry):
    first, again = (stages.CoherentNoise(specks=9).panel(geometry) for _ in range(2))
    other = stages.CoherentNoise(specks=9).panel(replace(geometry, seed=("test", 1)))
    assert torch.equal(first, again)
    assert not torch.equal(first, other)


def test_aberration_has_its_rms_over_the_iris(geometry):
    stage = stages.Propagation(aberration={"astigmatism_0": 0.1})
    f = torch.linspace(-0.4, 0.4, 301, dtype=torch.float64) / geometry.pitch
    fy, fx = f[:, None], f[None, :]
    inside = fy**2 + fx**2 <= (0.4 / geometry.pitch) ** 2
    waves = stage.pupil_phase(fy, fx, geometry, 0.8)[inside] / TAU
    assert float(waves.square().mean().sqrt()) == pytest.approx(0.1, rel=0.02)


def test_two_legs_of_the_way_are_the_way(geometry):
    stage = stages.Propagation(distance_error=0.01, aberration={"coma_x": 0.05})
    whole = stage.transfer(geometry, (128, 160), 0.8, (0.0, 1.0))
    legs = stage.transfer(geometry, (128, 160), 0.8, (0.0, 0.7)) * stage.transfer(geometry, (128, 160), 0.8, (0.7, 1.0))
    assert torch.allclose(whole, legs, atol=1e-4)


def test_straight_relay_samples_the_panel_at_its_pixels_and_turns_by_its_angle():
    points = stages.Relay().panel_points((64, 96), 6.4e-6, 3.2e-6)
    step = points[1, 0] - points[0, 0]
    assert torch.allclose(step, torch.tensor([0.5, 0.0], dtype=torch.float64))
    assert torch.allclose(points.mean((0, 1)), torch.tensor([31.5, 47.5], dtype=torch.float64), atol=1e-9)
    turned = stages.Relay(rotation=90).panel_points((64, 64), 6.4e-6, 6.4e-6)
    along = turned[10, 40] - turned[10, 39]
    assert torch.allclose(along, torch.tensor([-1.0, 0.0], dtype=torch.float64), atol=1e-9)


def test_sampling_is_exact_on_a_plane_and_dark_outside():
    rows = torch.arange(20.0)[:, None].expand(20, 30)
    points = torch.tensor([[[3.25, 4.5], [-5.0, 2.0]]], dtype=torch.float64)
    grid = sampling_grid(points, (20, 30))
    assert torch.allclose(sample(rows, grid, 1), torch.tensor([[3.25, 0.0]]), atol=1e-4)
    finer = (torch.arange(40.0) / 2)[:, None].expand(40, 60)
    assert torch.allclose(sample(finer, grid, 2), torch.tensor([[3.25, 0.0]]), atol=1e-4)


@given(st.floats(0.3, 5))
def test_pixel_area_keeps_a_constant_and_has_its_width(width):
    flat = torch.ones(1, 24, 24)
    assert torch.allclose(box_filter(flat, width), flat, atol=1e-5)
    point = torch.zeros(1, 25, 25)
    point[0, 12, 12] = 1
    assert float(box_filter(point, width).sum()) == pytest.approx(1, abs=1e-5)


def test_counts_of_an_ideal_camera_are_the_light_up_to_the_white_level():
    sensor = stages.Sensor(noise=False, dark=100)
    light = torch.rand(8, 8)
    counts = sensor.expose(light, 1000.0, torch.ones(8, 8), torch.zeros(8, 8))
    assert torch.allclose((counts - 100) / (1000 * sensor.counts_per_electron), light, atol=1e-4)
    counts = stages.Sensor(bits=12).expose(9 + light, stages.Sensor().full_well, torch.ones(8, 8), torch.zeros(8, 8))
    assert torch.all(counts == 4095)


def test_shot_and_read_noise_have_their_variance():
    sensor = stages.Sensor(full_well=30000, read_noise=10, bits=16, dark=500)
    counts = sensor.expose(torch.ones(300, 300), 5000.0, torch.ones(300, 300), normal(0, slice(0, 300), 300))
    electrons = (counts - 500) / sensor.counts_per_electron
    assert float(electrons.mean()) == pytest.approx(5000, rel=1e-3)
    assert float(electrons.var()) == pytest.approx(5000 + 100, rel=0.03)


def test_vignetting_darkens_the_corner(geometry):
    response = stages.Sensor(vignetting=0.2).response((50, 50), geometry)
    assert float(response[0, 0]) == pytest.approx(0.8, rel=1e-3)
    assert float(response[25, 25]) == pytest.approx(1, rel=1e-2)


def test_drift_takes_one_path_however_far_it_is_asked_for(geometry):
    at = {days: stages.Drift(days=days, gain=0.01).phase_gain(geometry) for days in (0, 30, 90, 90.5, 91)}
    assert at[0] == 1.0
    middle = math.log(at[90.5])
    assert middle == pytest.approx((math.log(at[90]) + math.log(at[91])) / 2)
    assert at[30] != at[90]


def test_drift_grows_as_a_random_walk(geometry):
    far = [stages.Drift(days=90).walk(replace(geometry, seed=("walk", n)), "power") for n in range(300)]
    assert torch.tensor(far).std().item() == pytest.approx(math.sqrt(90), rel=0.15)


FRAME = slice(0, 1000), 1003
COUNT = 1000 * 1003


def test_words_are_those_that_the_authors_of_philox_publish():
    zero = np.zeros(1, np.uint64)
    words = philox(zero, zero, (np.uint64(0), np.uint64(0)))  # Random123, kat_vectors: philox4x32 10, all zero
    assert [int(word[0]) for word in words] == [0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8]


def test_numbers_have_the_moments_and_the_tails_of_a_normal_distribution():
    z = normal(11, *FRAME).double()
    error = COUNT**-0.5
    assert abs(float(z.mean())) < 4 * error
    assert abs(float(z.square().mean()) - 1) < 4 * 2**0.5 * error
    assert abs(float(z.pow(3).mean())) < 4 * 15**0.5 * error
    assert abs(float(z.pow(4).mean()) - 3) < 4 * 96**0.5 * error
    for sigma, share in ((1, 0.317311), (2, 0.045500), (3, 0.0026998), (4, 6.334e-5)):
        wanted = share * COUNT
        assert abs(int((z.abs() > sigma).sum()) - wanted) < 4 * wanted**0.5 + 1


@pytest.mark.parametrize(
    "other", ["next key", "key of the other half", "next row", "next column", "next quarter", "square"]
)
def test_neighbours_are_not_correlated(other):
    z = normal(11, *FRAME)
    shifted = {
        "next key": lambda: normal(12, *FRAME),
        "key of the other half": lambda: normal(11 + (1 << 32), *FRAME),
        "next row": lambda: z.roll(1, 0),
        "next column": lambda: z.roll(1, 1),
        "next quarter": lambda: z.roll(251, 1),
        "square": lambda: z.roll(251, 1).square() - 1,  # numbers of a pair have no common radius
    }[other]()
    assert abs(float((z.double() * shifted).mean())) < 5 * COUNT**-0.5
    assert abs(float(((z.double().square() - 1) * shifted).mean())) < 8 * COUNT**-0.5


def test_numbers_do_not_depend_on_the_block_of_rows_that_they_are_drawn_in_or_on_numba(monkeypatch):
    parts = [normal(5, slice(first, first + 30), 77) for first in (0, 30, 60)]
    assert torch.equal(normal(5, slice(0, 90), 77), torch.cat(parts))
    fast = normal(2**63 - 9, slice(7, 60), 130)
    monkeypatch.setattr(compiled, "AVAILABLE", False)
    assert torch.allclose(fast, normal(2**63 - 9, slice(7, 60), 130), atol=2e-6)


def test_a_capture_is_the_same_for_any_number_of_threads_and_new_in_every_channel_and_frame():
    bench = SimulatedBench(load_profile("leto-aged").scaled((512, 704)))  # more than one block of the sensor
    phase, before = torch.zeros(3, 512, 704), torch.get_num_threads()
    frames = []
    for threads in (1, 3):
        torch.set_num_threads(threads)
        session = bench.session("test", exposure=(4000.0,) * 3)
        frames.append(torch.stack([session.capture(phase).frame for _ in range(2)]))
    torch.set_num_threads(before)
    assert torch.equal(*frames)
    noise = (frames[0] - frames[0].mean((-2, -1), keepdim=True)).flatten(0, 1).flatten(1)
    keys = {tuple(row[:50].tolist()) for row in noise}
    assert len(keys) == 6
