"""The quantities of a bench are those of its profile, and do not depend on what images leave open."""

import cmath
import math
from dataclasses import replace

import pytest
import torch

from holobench_eval.display import estimates, load_profile
from holobench_eval.display.simulated.ground_truth import truth
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.display.simulated.profile import Profile, names
from holobench_eval.display.simulated.stages import Illumination, LookUpTable, PixelAperture, Propagation, ZeroOrder
from holobench_eval.optics.phase import TAU
from holobench_eval.optics.zernike import NAMES, zernike

SMALL = (64, 64)


def told(profile: Profile) -> dict[tuple[str, int | None], float]:
    return {(one.name, one.colour): one.value for one in truth(SimulatedBench(profile.scaled(SMALL)))}


@pytest.mark.parametrize("name", names())
def test_every_display_tells_every_quantity_of_every_colour_once_and_in_its_unit(name: str) -> None:
    bench = SimulatedBench(load_profile(name).scaled(SMALL))
    found, colours = truth(bench), range(len(bench.channels))
    keys = [(one.name, one.colour) for one in found]
    assert len(keys) == len(set(keys))
    without = ("undiffracted_phase", "stray_reach", *(estimates.MODES if bench.spec.plane == "fourier" else ()))
    absent = {(quantity, colour) for quantity in without for colour in colours}
    assert set(keys) | absent == {(quantity, colour) for quantity in estimates.QUANTITIES for colour in colours}
    assert all(one.unit == estimates.QUANTITIES[one.name].unit and math.isfinite(one.value) for one in found)


def test_an_ideal_display_has_a_straight_table_all_light_and_no_aberration() -> None:
    for (name, _), value in told(load_profile("ideal")).items():
        wanted = {"lut_exponent": 1, "phase_gain": 1, "light": 1}.get(name, 0)
        assert value == pytest.approx(wanted, abs=2e-6), name


def test_exponent_and_gain_are_those_of_the_profile() -> None:
    found = told(load_profile("leto-aged"))
    for colour, (gamma, gain) in enumerate(((1.28, 0.88), (1.25, 0.90), (1.22, 0.93))):
        assert found["lut_exponent", colour] == pytest.approx(gamma, abs=1e-4)
        assert found["phase_gain", colour] == pytest.approx(gain, abs=1e-4)


def test_without_dead_area_the_undiffracted_share_and_phase_are_those_of_the_zero_order() -> None:
    found = told(replace(load_profile("ideal"), zero_order=ZeroOrder(0.2, -0.6), sampling=3))
    for colour in range(3):
        assert found["undiffracted_fraction", colour] == pytest.approx(0.2)
        assert found["undiffracted_phase", colour] == pytest.approx(-0.6)


def test_dead_area_reflects_in_phase_with_the_beam_and_adds_to_the_zero_order() -> None:
    """Amplitudes by hand: the zero order takes a share of the power, the pixels divide what is left by area."""
    aperture = PixelAperture(fill=0.9, dead_amplitude=0.5)
    profile = replace(load_profile("ideal"), zero_order=ZeroOrder(0.2, -0.6), aperture=aperture, sampling=3)
    still = math.sqrt(0.2) * cmath.exp(-0.6j) + math.sqrt(0.8) * 0.1 * 0.5
    moved = math.sqrt(0.8) * 0.9
    found = told(profile)
    assert found["undiffracted_fraction", 1] == pytest.approx(abs(still) ** 2 / (abs(still) ** 2 + moved**2), rel=1e-5)
    assert found["undiffracted_phase", 1] == pytest.approx(cmath.phase(still), rel=1e-5)


def test_aberrations_are_in_waves_of_the_colour() -> None:
    profile = replace(load_profile("ideal"), propagation=Propagation(aberration={"coma_x": 0.05, "trefoil_y": 0.02}))
    found = told(profile)
    for colour, wavelength in enumerate(profile.panel.wavelengths):
        assert found["coma_x", colour] == pytest.approx(0.05 * 517e-9 / wavelength, rel=1e-3)
        assert found["trefoil_y", colour] == pytest.approx(0.02 * 517e-9 / wavelength, rel=1e-3)
        assert found["coma_y", colour] == pytest.approx(0, abs=1e-6)


def test_a_wrong_distance_is_defocus_as_paraxial_optics_has_it() -> None:
    """The phase -pi lambda z e f^2 over the iris, in polynomials sqrt(3) (2 rho^2 - 1) of unit rms."""
    profile = replace(load_profile("ideal"), propagation=Propagation(distance_error=0.004)).scaled(SMALL)
    panel = profile.panel
    found = told(profile)
    for colour, wavelength in enumerate(panel.wavelengths):
        edge = (panel.pupil or 1) / (2 * panel.pitch)
        wanted = -wavelength * panel.distance * 0.004 * edge**2 / (4 * math.sqrt(3))
        assert found["defocus", colour] == pytest.approx(wanted, rel=0.01)


def test_a_curved_beam_defocuses_by_the_square_of_the_distance_over_its_radius() -> None:
    """A beam that converges at R is focused as the way z^2 / R more would be (1/z' = 1/z - 1/R)."""
    wavelength, distance, pitch, radius = 517e-9, 0.02, 6.4e-6, 3.0
    rows = (torch.arange(200) - 99.5) * pitch
    beam = -math.pi * (rows[:, None] ** 2 + rows[None, :] ** 2) / (wavelength * radius)
    y, x = estimates.disc()
    edge = 0.8 / (2 * pitch)
    longer = -math.pi * wavelength * (distance**2 / radius) * edge**2 * (y**2 + x**2)
    far = estimates.reach(wavelength, distance, pitch, 0.8)
    found = estimates.focusing(beam, far)
    assert torch.allclose(found, longer, rtol=1e-6, atol=1e-9)
    tilted = estimates.focusing(beam + 3 * rows[:, None] / rows.max() + 1, far)
    assert torch.allclose(tilted, longer, rtol=1e-6, atol=1e-9)


def test_the_beam_of_a_display_is_part_of_its_focus() -> None:
    found = told(replace(load_profile("ideal"), illumination=Illumination(phase_rms=0.3)))
    assert abs(found["astigmatism_45", 0]) + abs(found["astigmatism_0", 0]) > 1e-3
    assert found["coma_x", 0] == pytest.approx(0, abs=1e-6)


def test_coefficients_come_back_from_their_polynomials() -> None:
    y, x = estimates.disc()
    phase = TAU * (0.1 * zernike(NAMES["defocus"], y, x) - 0.03 * zernike(NAMES["coma_y"], y, x)) + 0.7
    found = estimates.zernike_waves(phase)
    assert found["defocus"] == pytest.approx(0.1)
    assert found["coma_y"] == pytest.approx(-0.03)
    assert found["spherical"] == pytest.approx(0, abs=1e-9)


def test_a_stroke_is_found_whatever_constant_is_added() -> None:
    levels = torch.linspace(0.05, 0.95, 20, dtype=torch.float64)
    law = estimates.stroke(levels, TAU * (0.9 * levels**1.3 + 0.4))
    assert (law.exponent, law.gain, law.offset) == pytest.approx((1.3, 0.9, 0.4), abs=1e-5)


def test_a_published_table_has_the_law_nearest_to_it() -> None:
    table = tuple(100 * (level / 15) ** 2 for level in range(16))
    profile = replace(load_profile("plm-4bit"), lut=LookUpTable(table=table))
    assert told(profile)["lut_exponent", 0] == pytest.approx(2, abs=0.02)


def test_an_iris_beside_the_zero_order_leaves_none_of_it_and_next_to_none_has_no_phase() -> None:
    found = told(load_profile("pluto-offaxis"))
    assert found["undiffracted_fraction", 1] == 0
    assert ("undiffracted_phase", 1) not in found
    assert [one.name for one in estimates.undiffracted(0.01 + 0j, 0)] == ["undiffracted_fraction"]


def test_estimates_stand_beside_the_truth_of_their_name_and_colour() -> None:
    found = [estimates.estimate("crosstalk", 0, 0.5), estimates.Estimate("hue", None, math.nan, "deg")]
    truths = [estimates.estimate("crosstalk", colour, value) for colour, value in ((1, 0.1), (0, 0.45))]
    first, other = estimates.joined(found, truths)
    known = {"name": "crosstalk", "colour": 0, "unit": "px", "error": estimates.QUANTITIES["crosstalk"].error}
    assert first == known | {"value": 0.5, "truth": 0.45}
    assert (other["value"], other["truth"], other["error"]) == (None, None, None)
