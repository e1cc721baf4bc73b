"""Changes of a bench at test time and random draws of it: of the stages that they name, and of no other."""

import itertools
from dataclasses import fields, replace

import pytest
import torch

from holobench_eval.core.errors import UserError
from holobench_eval.core.plugins import build
from holobench_eval.display import load_profile
from holobench_eval.display.simulated.changes import KINDS, altered, checked
from holobench_eval.display.simulated.changes.camera import SENSORS
from holobench_eval.display.simulated.changes.draws import PARAMETERS, STAGES, drawn, values
from holobench_eval.display.simulated.changes.kind import Kind
from holobench_eval.display.simulated.changes.vision import EYEPIECE, Prescription
from holobench_eval.display.simulated.profile import names
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.metrics import score
from holobench_eval.optics.phase import blaze
from holobench_eval.study.config import load_study
from holobench_eval.study.opening import open_bench
from holobench_eval.study.plan import plan

PANEL = (128, 128)
EXAMPLES = {
    "camera_shift_x": 30.0,
    "camera_shift_y": -20.0,
    "drift": 60.0,
    "sensor": "fujifilm-s5-pro",
    "distance": 0.5,
    "wavelength": 1.0,
    "defocus": 0.2,
    "laser_power": 0.5,
    "temperature": 20.0,
    "obstruction": 0.3,
    "bits": 4.0,
    "sibling": "3",
    "ambient": 0.05,
    "refocus": 2.0,
    "other_plane": 2.0,
    "eye": "-2 / -1 x 30",
    "corrected_eye": "-2 / -1 x 30",
    "known_eye": "-2 / -1 x 30",
    "eye_pupil": "0.5",
    "draw": "1",
}


def picture(shape):
    dataset = build("datasets", "photographs", {"count": 2}, None)
    return dataset.load(dataset.items()[1], shape, channels=3)


def changed_fields(before, after):
    return {item.name for item in fields(before) if getattr(before, item.name) != getattr(after, item.name)}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["leto-aged", "ideal"])
def test_a_condition_changes_the_stages_that_it_names_and_no_other(name, kind):
    assert set(EXAMPLES) == set(KINDS)
    profile = load_profile(name)
    found = changed_fields(profile, altered(profile, kind, EXAMPLES[kind]))
    assert found <= set(KINDS[kind].stages)
    if name == "leto-aged":
        assert found
        assert found == set(KINDS[kind].stages) or kind == "draw"


@pytest.mark.parametrize("kind", [kind for kind in KINDS if KINDS[kind].numeric])
def test_the_nominal_value_changes_nothing(kind):
    profile = load_profile("leto-aged")
    assert altered(profile, kind, KINDS[kind].nominal) is profile
    applied = KINDS[kind].apply(profile, KINDS[kind].nominal)
    assert changed_fields(profile, applied) <= {"propagation", "panel"}
    assert applied.spec(PANEL) == profile.spec(PANEL)


WRONG = {"drift": (-1, "a year", True), "camera_shift_x": (41,), "bits": (0, 2.5), "temprature": (1,)}
WRONG |= {"sensor": ("canon",), "eye": ("two", "-30"), "sibling": ("twin",)}


@pytest.mark.parametrize(("kind", "value"), [(kind, value) for kind, values in WRONG.items() for value in values])
def test_a_value_out_of_range_or_without_a_meaning_is_refused(kind, value):
    with pytest.raises(UserError):
        altered(load_profile("leto-aged"), kind, checked(kind, value))
    with pytest.raises(UserError, match="smooth look-up table"):  # a table of levels has bits of its own
        altered(load_profile("plm-4bit"), "bits", 3.0)


def test_a_value_has_one_form_however_it_is_written():
    assert checked("sibling", 3) == checked("sibling", 3.0) == checked("sibling", "3") == "3"
    assert checked("eye", "-2/-1x30") == checked("eye", "-2 / -1 x 30") == "-2 / -1 x 30"
    assert checked("eye", -2) == checked("known_eye", "-2.0") == "-2"
    for wrong in (0, "01", 1.5, "1_0", -1):
        with pytest.raises(UserError):
            checked("sibling", wrong)
    for place in ("left", "1.5", "nan"):
        with pytest.raises(UserError, match=f"eye_pupil '{place}': expected places from '-1' to '1' radii of the iris"):
            checked("eye_pupil", place)


def test_a_change_adds_to_what_the_profile_has_and_sensors_have_their_published_pitch():
    assert SENSORS["canon-t6i"].pitch == 3.72e-6
    assert SENSORS["fujifilm-s5-pro"].pitch == pytest.approx(23e-3 / 4256, rel=2e-3)
    profile = load_profile("leto-aged")
    aged = replace(profile, drift=replace(profile.drift, days=30.0))
    assert altered(aged, "drift", 10.0).drift.days == 40
    moved = altered(profile, "camera_shift_x", 20.0)
    assert altered(moved, "camera_shift_x", 20.0).propagation.pupil_shift[1] == pytest.approx(0.25)


def test_dust_settles_speck_by_speck_and_stays():
    profile = load_profile("leto-aged")
    geometry = open_bench(profile, PANEL).bench.channels[1].geometry
    drifts = [replace(profile.drift, days=days) for days in (0, 30, 60, 365)]
    shades = [drift.dust(geometry, profile.coherent_noise) for drift in drifts]
    assert torch.equal(shades[0], torch.ones(PANEL, dtype=torch.float64))
    for earlier, later in itertools.pairwise(shades):
        assert (later <= earlier).all()
        assert (later < earlier).any()
    clean = replace(profile.coherent_noise, specks=0)
    assert torch.equal(drifts[-1].dust(geometry, clean), torch.ones(PANEL, dtype=torch.float64))


def test_a_warm_panel_has_less_stroke_by_the_law_of_its_birefringence():
    gains = [altered(load_profile("ideal"), "temperature", kelvin).lut.gain[1] for kelvin in (-20.0, 10.0, 40.0)]
    assert gains[0] > 1 > gains[1] > gains[2]
    assert gains[1] == pytest.approx(0.967, abs=2e-3)


def test_twice_the_power_gives_twice_the_light_and_ambient_light_an_offset():
    profile = load_profile("ideal")
    phase = torch.zeros(3, *PANEL)

    def light(one):
        session = open_bench(one, PANEL).bench.session("a", exposure=(1e3,) * 3)
        return session.capture(phase).linear()

    plain, bright = light(profile), light(altered(profile, "laser_power", 2.0))
    assert torch.allclose(bright, 2 * plain, rtol=1e-4, atol=1e-6)
    sensor = profile.sensor
    added = light(altered(profile, "ambient", 0.1)) - plain
    assert torch.allclose(added, torch.full_like(added, 0.1 * sensor.full_well / sensor.headroom / 1e3), rtol=1e-3)


def test_an_obstructed_pupil_loses_low_frequencies_and_a_shifted_one_is_no_longer_even():
    profile = load_profile("ideal")
    bench = open_bench(profile, PANEL).bench
    blocked = open_bench(altered(profile, "obstruction", 0.3), PANEL).bench
    moved = open_bench(altered(profile, "camera_shift_x", 40.0), PANEL).bench
    transfer, less, other = (
        one.profile.propagation.transfer(
            one.channels[1].geometry, (192, 192), one.profile.panel.pupil, (0.0, 1.0)
        ).abs()
        for one in (bench, blocked, moved)
    )
    assert transfer[0, 0] == pytest.approx(1)
    assert less[0, 0] == pytest.approx(0, abs=1e-6)
    assert less.max() == pytest.approx(1)
    middle = transfer.shape[1] // 2
    assert torch.allclose(transfer[0, 1:middle], transfer[0, -middle + 1 :].flip(0)[: middle - 1])
    assert other[0, 1:middle].sum() > 1.2 * other[0, -middle + 1 :].sum()


def test_a_kind_and_a_row_make_a_change_that_a_study_can_sweep(tmp_path, monkeypatch):
    def flicker(profile, added):
        return replace(profile, flicker=replace(profile.flicker, rms=profile.flicker.rms + added))

    kind = Kind("flicker of the panel", "of the stroke", ("flicker",), flicker, "added", low=0, high=0.1)
    monkeypatch.setitem(KINDS, "flicker", kind)
    (tmp_path / "study.yaml").write_text(
        "title: A year\ndisplay: {profiles: [leto-mild], panel: [192, 192]}\ntargets: {dataset: charts}\n"
        "sweeps: [{condition: flicker, values: [0.01, 0.02]}]\nmethods: [wirtinger]\n"
    )
    cells = plan(load_study(tmp_path / "study.yaml")).cells
    names = {cell.condition for cell in cells} - {"reference"}
    assert names == {"leto-mild", *(f"leto-mild, flicker {added} of the stroke" for added in (0.01, 0.02))}


def test_prescriptions_are_read_as_they_are_written():
    assert Prescription.read("-2") == Prescription(-2)
    assert Prescription.read("+1.5 / -0.75 x 90") == Prescription(1.5, -0.75, 90)
    assert Prescription.read("-2/-1x30") == Prescription(-2, -1, 30)
    for wrong in ("", "2 D", "-2 / -1", "-2 / -1 x 200", "nan", "-20"):
        with pytest.raises(UserError):
            Prescription.read(wrong)


def test_a_short_sighted_eye_sees_a_plane_further_from_the_panel_and_a_cylinder_one_meridian_of_it():
    rows, columns, cross = Prescription(-2).shift()
    assert rows == columns == pytest.approx(2 * EYEPIECE**2)
    assert cross == 0
    rows, columns, cross = Prescription(0, -1, 0).shift()  # power across a horizontal axis: vertical
    assert (rows, columns, cross) == pytest.approx((EYEPIECE**2, 0, 0))
    rows, columns, cross = Prescription(0, -1, 90).shift()
    assert (rows, columns, cross) == pytest.approx((0, EYEPIECE**2, 0), abs=1e-12)
    rows, columns, cross = Prescription(-1, 0.5, 30).shift()
    plus = Prescription(-0.5, -0.5, 120).shift()  # the same glasses in the other notation
    assert (rows, columns, cross) == pytest.approx(plus)


def psnr(solver, shown):
    """Of a hologram that is found for one bench and shown on another."""
    target, method = picture((104, 104)), Wirtinger(iterations=40)
    phase = method.solve(target[None], solver.for_method(method, "w", target, "x", 0))[0]
    return score(shown.photograph(phase, target, "x", 0).image, target)["psnr_linear"]


def test_an_eye_that_needs_glasses_loses_the_picture_and_gets_it_back_from_the_hologram():
    """Two samples a pixel, so that a picture between the pixels is seen as it is."""
    profile = replace(load_profile("ideal"), sampling=2)
    nominal = open_bench(profile, PANEL)

    def lost(kind, own):
        bench = open_bench(altered(profile, kind, "-2 / 1 x 30"), PANEL, 0, None if KINDS[kind].moves else nominal)
        return before - psnr(bench if own else nominal, bench)

    before = psnr(nominal, nominal)
    uncorrected = lost("eye", own=False)
    assert uncorrected > 8
    assert lost("corrected_eye", own=False) < 0.1 * uncorrected
    assert lost("known_eye", own=True) < 0.1 * uncorrected


def test_a_lens_moves_the_image_without_loss_where_the_camera_follows():
    profile = replace(load_profile("ideal"), sampling=2)
    nominal = open_bench(profile, PANEL)
    left = open_bench(altered(profile, "other_plane", 2.0), PANEL, 0, nominal)
    before = psnr(nominal, nominal)
    for millimetres in (-2.0, 2.0):
        moved = open_bench(altered(profile, "refocus", millimetres), PANEL)
        assert abs(psnr(nominal, moved) - before) < 1
    assert psnr(nominal, left) < before - 3
    assert left.registration is nominal.registration  # of a camera that is not moved


def test_an_eye_sees_the_light_that_is_tilted_into_its_pupil():
    profile = load_profile("ideal")  # an iris of 0.4 cycles a pixel
    eye, camera = (open_bench(each, PANEL).bench for each in (altered(profile, "eye_pupil", "0.5"), profile))
    tilted = [blaze(PANEL, (0.0, tilt)) for tilt in (0.0, 0.1, 0.2, 0.3, -0.2)]
    seen = [float(eye.intensity(phase, 1).mean() / camera.intensity(phase, 1).mean()) for phase in tilted]
    assert seen == pytest.approx([0.25, 1, 1, 1, 0], abs=0.03)  # at the soft edge half of the amplitude


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
