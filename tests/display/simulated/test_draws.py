"""Random draws of a bench: within their ranges, repeatable, and of what they are said to change alone."""

from dataclasses import fields, replace

import pytest
import torch

from holobench_eval.display import load_profile
from holobench_eval.display.simulated.changes.draws import PARAMETERS, STAGES, drawn, values
from holobench_eval.display.simulated.profile import names
from holobench_eval.study.opening import open_bench

PANEL = (128, 128)
DRAWS = range(1, 201)
READ = {
    "gamma": lambda p: p.lut.gamma[1],
    "gain": lambda p: p.lut.gain[1],
    "crosstalk": lambda p: p.crosstalk.width,
    "fill": lambda p: p.aperture.fill,
    "flicker": lambda p: p.flicker.rms,
    "beam": lambda p: p.illumination.beam_sigma,
    "fringes": lambda p: p.illumination.fringes,
    "wavefront": lambda p: p.illumination.phase_rms,
    "distance": lambda p: 100 * p.propagation.distance_error,
    "astigmatism": lambda p: p.propagation.aberration["astigmatism_0"] / (0.45 / 0.8) ** 2,
    "coma": lambda p: p.propagation.aberration["coma_x"] / (0.45 / 0.8) ** 3,
    "zero_order": lambda p: p.zero_order.fraction,
    "zero_phase": lambda p: p.zero_order.phase,
    "specks": lambda p: p.coherent_noise.specks,
    "linewidth": lambda p: 1e9 * p.spectrum.width[1],
    "stray": lambda p: p.stray_light.share,
    "reach": lambda p: p.stray_light.reach,
}
"""Where a drawn value has to arrive on the bench."""


@pytest.fixture(scope="module")
def profile():
    return load_profile("leto-2020")


def test_values_stay_in_their_ranges_and_reach_near_both_ends(profile):
    every = [values(profile, index) for index in DRAWS]
    assert len({drawn(profile, index).seed for index in DRAWS} | {profile.seed}) == len(DRAWS) + 1
    for name, one in PARAMETERS.items():
        column = [found[name] for found in every]
        near = 0.05 * (one.high - one.low)
        assert one.low <= min(column) < one.low + near, name
        assert one.high - near < max(column) <= one.high, name


def test_a_draw_depends_on_the_name_and_seed_of_the_profile_and_on_its_number_alone(profile):
    assert values(profile, 3) == values(profile, 3) == values(profile.scaled(PANEL), 3)
    assert values(replace(profile, lut=load_profile("ideal").lut, version=9), 3) == values(profile, 3)
    for other in (values(profile, 4), values(replace(profile, seed=2), 3), values(replace(profile, name="x"), 3)):
        assert all(other[name] != value for name, value in values(profile, 3).items())


def test_no_two_parameters_are_drawn_together(profile):
    every = torch.tensor([list(values(profile, index).values()) for index in DRAWS], dtype=torch.float64)
    correlation = torch.corrcoef(every.T) - torch.eye(len(PARAMETERS), dtype=torch.float64)
    assert correlation.abs().max() < 0.3


def test_every_value_arrives_on_the_bench(profile):
    found, made = values(profile, 5), drawn(profile, 5)
    assert set(READ) == set(PARAMETERS)
    for name, read in READ.items():
        assert read(made) == pytest.approx(round(found[name]) if name == "specks" else found[name]), name


@pytest.mark.parametrize("name", names())
def test_a_draw_changes_the_stages_that_it_names_and_no_other(name):
    profile = load_profile(name)
    made = drawn(profile, 1)
    changed = {item.name for item in fields(profile) if getattr(made, item.name) != getattr(profile, item.name)}
    assert changed <= set(STAGES)
    assert {"seed", "lut", "crosstalk", "illumination", "propagation", "zero_order"} <= changed
    assert made.spec() == profile.spec()


def test_a_source_that_is_no_laser_keeps_its_spectrum_and_without_an_iris_aberrations_are_of_the_whole_band(profile):
    broad = load_profile("leto-sled")
    assert drawn(broad, 5).spectrum == broad.spectrum
    none, whole = (drawn(replace(profile, panel=replace(profile.panel, pupil=pupil)), 5) for pupil in (None, 1.0))
    assert none.propagation == whole.propagation


def test_a_drawn_bench_is_built_and_photographs():
    profile = load_profile("leto-aged")
    phase = 6 * torch.rand(3, *PANEL, generator=torch.Generator().manual_seed(1))
    target = torch.full((3, 104, 104), 0.5)
    images = []
    for index in (2, 3):
        shot = open_bench(drawn(profile, index), PANEL, seed=2020).photograph(phase, target, "flat", 0)
        assert shot.residual < profile.residual_bound
        images.append(shot.image)
    assert not torch.allclose(*images, atol=0.05)
