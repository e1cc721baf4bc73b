"""Profiles are read with their effects, and a fault in one is a line with its place."""

import math
import re
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from holobench_eval.commands.show import effects as listed
from holobench_eval.core.errors import UserError
from holobench_eval.display import load_profile
from holobench_eval.display.simulated.profile import names
from holobench_eval.display.simulated.stages import Flicker, LookUpTable
from holobench_eval.display.simulated.trust import Trust
from holobench_eval.methods.calibrated.display_model import FORM
from holobench_eval.optics.padding import spread

PROFILES = files("holobench_eval.display.simulated") / "profiles"


@settings(max_examples=40)
@given(rows=st.integers(64, 700), columns=st.integers(64, 1200), name=st.sampled_from(names()))
def test_scaling_keeps_pitch_and_relative_spread(rows, columns, name):
    full, small = load_profile(name).spec(), load_profile(name).spec((rows, columns))
    assert small.pitch == full.pitch
    relative = [spread(s.pitch, s.wavelengths[0], s.distance) / s.shape[0] for s in (full, small)]
    assert relative[0] == pytest.approx(relative[1])
    assert small.region.height <= rows
    assert small.region.top + small.region.height <= small.shape[0]
    if name != "pluto-fourier":  # whose window lies beside the zero order
        assert small.region.top * 2 + small.region.height in (rows, rows - 1)


def test_no_panel_is_larger_than_the_display_and_scaling_is_said():
    assert "full panel" in load_profile("ideal").scaling_note(None)
    assert "the distance goes from 100 to 23.7 mm" in load_profile("ideal").scaling_note((256, 256))
    profile = load_profile("leto-aged").scaled((100, 120))
    assert (profile.usual, load_profile("leto-aged").usual) == ((100, 120), (256, 256))
    for larger in ((101, 110), (100, 121), (5000, 5000)):
        message = (
            f"^the panel of 'leto-aged' has 100 x 120 pixels, not {re.escape(str(list(larger)))}; give at most these$"
        )
        with pytest.raises(UserError, match=message):
            profile.scaled(larger)


def test_digest_follows_the_file(tmp_path):
    text = (PROFILES / "ideal.yaml").read_text()
    (tmp_path / "mine.yaml").write_text(text)
    assert load_profile("mine.yaml", tmp_path).digest == load_profile("ideal").digest
    (tmp_path / "mine.yaml").write_text(text + "# changed\n")
    assert load_profile("mine.yaml", tmp_path).digest != load_profile("ideal").digest


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("bits: 8", "bits: many"), r"mine.yaml:\d+:\d+: panel.bits should be a whole number"),
        (("sensor:", "sensro:"), r"mine.yaml:\d+:1: unknown key 'sensro'.*did you mean 'sensor'"),
        (("pitch: 6.4e-6", "pitch: 6.4"), r"panel.pitch: 6.4 is not in .* m; lengths are in metres: 6.4e-6$"),
        (("6.36e-7, 5.17e-7, 4.46e-7", "532"), r"wavelengths\[0\]: 532 is not in .*; lengths are in metres: 532e-9$"),
        ((", 4.46e-7]", "]"), r"panel.wavelengths: 2 wavelengths; a display has three, .* or one, for gray pictures$"),
        (("5.17e-7, 4.46e-7]", "4.46e-7, 5.17e-7]"), r"red comes first, .*: \[6.36e-07, 5.17e-07, 4.46e-07\]$"),
        (("version: 1\n", ""), "missing key 'version'"),
        (("", "lut: {bend: 0.25}\n"), ":4:13: 0.25 bends some exponents to zero"),
        (("", "spectrum: {measured: [[[0, 1]]]}\n"), ":4:22: there are 1 measured spectra; the panel has 3"),
        (("", "spectrum: {width: [1e-3, 0, 0]}\n"), r":4:2.: spectrum\.width\[0\].* should be .* than or equal to"),
    ],
)
def test_a_fault_in_a_profile_is_one_line_with_its_place(tmp_path, change, message):
    text = (PROFILES / "ideal.yaml").read_text()
    if not change[0]:
        change = ("version: 1\n", f"version: 1\n{change[1]}")
    assert change[0] in text
    (tmp_path / "mine.yaml").write_text(text.replace(*change))
    with pytest.raises(UserError, match=message) as caught:
        load_profile("mine.yaml", tmp_path)
    assert "\n" not in str(caught.value)


def test_an_unknown_profile_and_a_panel_that_cannot_be_are_refused():
    with pytest.raises(UserError, match="did you mean 'leto-aged'"):
        load_profile("leto-agde")
    with pytest.raises(UserError, match="no such file"):
        load_profile("none.yaml")
    for shape in ((10, 10), (64, 100000)):
        with pytest.raises(UserError, match="64 to 8192"):
            load_profile("ideal").spec(shape)


def test_a_profile_like_another_has_its_values_where_it_gives_none(tmp_path):
    (tmp_path / "near.yaml").write_text("like: leto-aged\nname: near\nsensor: {full_well: 320}\n")
    (tmp_path / "far.yaml").write_text("like: near.yaml\nname: far\ncrosstalk: {width: 0.1}\n")
    base, far = load_profile("leto-aged"), load_profile("far.yaml", tmp_path)
    assert (far.name, far.sensor.full_well, far.crosstalk.width) == ("far", 320, 0.1)
    assert (far.sensor.read_noise, far.lut, far.panel) == (base.sensor.read_noise, base.lut, base.panel)
    digest = far.digest
    (tmp_path / "near.yaml").write_text("like: leto-aged\nname: near\nsensor: {full_well: 640}\n")
    assert load_profile("far.yaml", tmp_path).digest != digest


@pytest.mark.parametrize(
    ("mine", "base", "message"),
    [
        ("like: leto-agde", "", r"mine.yaml:2:7: unknown profile 'leto-agde'; did you mean 'leto-aged'"),
        ("like: mine.yaml", "", r"mine.yaml:2:7: more than 4 profiles, each of them like the next"),
        ("like: ideal\nsensor: 3", "", r"mine.yaml:3:9: sensor should be a mapping"),
        ("like: base.yaml", "crosstalk: {widht: 3}", r"/base.yaml:2:13: unknown key 'widht'"),
        ("like: base.yaml", "crosstalk: {width: wide}", r"/base.yaml:2:20: crosstalk.width"),
        ("like: base.yaml", "panel: {bits: 5}", r"/base.yaml:\d+:\d+: .*16 entries; a panel of 5 bits has 32"),
    ],
)
def test_a_fault_is_told_of_the_file_that_has_it_the_profile_or_its_base(tmp_path, mine, base, message):
    (tmp_path / "base.yaml").write_text(f"like: plm-4bit\n{base}\n")
    (tmp_path / "mine.yaml").write_text(f"name: mine\n{mine}\n")
    with pytest.raises(UserError, match=message):
        load_profile("mine.yaml", tmp_path)


@pytest.mark.parametrize("stage", ["panel: {bits: 4, levels", "lut: {table"])
@pytest.mark.parametrize(
    ("full", "says"),
    [
        (math.tau * 15 / 16, "in radians each entry times 16.98$"),
        (337.5, "in degrees each entry times 0.2963$"),
        (0.9375, "in turns each entry times 106.7$"),
        (4095, "170$"),
        (0, "170$"),
        (100, ""),
        (60, ""),
    ],
)
def test_a_table_of_levels_in_another_unit_is_refused_with_its_factor(tmp_path, stage, full, says):
    levels = [full * (level / 15) ** 2 for level in range(16)]
    (tmp_path / "mine.yaml").write_text(f"name: mine\nlike: plm-4bit\n{stage}: {levels}}}\n")
    if not says:
        assert max(load_profile("mine.yaml", tmp_path).panel.levels) > 0
        return
    with pytest.raises(UserError, match=rf"mine.yaml:3:\d+: the table spans .* turns; expected 20 to .*{says}"):
        load_profile("mine.yaml", tmp_path)


def test_a_base_is_looked_for_beside_the_file_that_names_it_and_nowhere_else(tmp_path, monkeypatch):
    (tmp_path / "mine.yaml").write_text("like: base.yaml\nname: mine\n")
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "base.yaml").write_text("like: ideal\nname: base\n")
    monkeypatch.chdir(elsewhere)
    assert load_profile("base.yaml", tmp_path).name == "base"  # a study's own, by contrast, may be given from here
    with pytest.raises(UserError, match=r"mine.yaml:1:7: profile 'base.yaml': no such file: .*/base.yaml"):
        load_profile("mine.yaml", tmp_path)
    with pytest.raises(UserError, match="no such file"):
        load_profile("../mine.yaml")


def found(name: str) -> set[str]:
    return {one.name for one in load_profile(name).effects()}


def test_an_effect_is_listed_when_it_is_switched_on() -> None:
    ideal = load_profile("ideal")
    assert found("ideal") == {"quantisation"}
    flickering = {one.name: one.text for one in replace(ideal, flicker=Flicker(0.02)).effects()}
    assert flickering.keys() - {"quantisation"} == {"flicker"}
    assert "2 %" in flickering["flicker"]
    bent = replace(ideal, lut=LookUpTable(gamma=(1.0, 1.2, 1.0)))
    assert "1/1.2/1" in next(one.text for one in bent.effects() if one.name == "look_up_table")


def test_uneven_effects_are_outside_the_form_of_the_model() -> None:
    aged = load_profile("leto-aged")
    uneven = replace(
        aged,
        lut=replace(aged.lut, bend=0.03),
        crosstalk=replace(aged.crosstalk, ratio=1.4),
        flicker=replace(aged.flicker, ripple=0.02),
    )
    more = {one.name for one in uneven.effects()} - found("leto-aged")
    assert more == {"uneven_table", "uneven_crosstalk", "ripple"}
    assert more.isdisjoint(FORM)


def test_no_effect_is_listed_twice_and_a_form_names_only_those_that_some_display_has_or_may_have() -> None:
    told = [[one.name for one in load_profile(name).effects()] for name in names()]
    assert all(len(effects) == len(set(effects)) for effects in told)
    everywhere = set().union(*told)
    assert FORM - everywhere <= {"drift", "astigmatism_45", "coma_y", "spherical", "offset"}


def test_the_form_of_the_model_is_wrong_for_leto_aged_and_more_so_for_the_dusty_one() -> None:
    for name in ("leto-aged", "leto-dusty"):
        lacking = {effect for effect, _, modelled in listed(name) if not modelled}
        assert {"sub_pixel_field", "pixel_aperture", "flicker", "plane_dust", "roughness", "noise"} <= lacking
        assert {"look_up_table", "crosstalk", "zero_order", "defocus", "coma_x"}.isdisjoint(lacking)
    assert "trefoil_y" in {effect for effect, _, modelled in listed("leto-dusty") if not modelled}
    lacking = {effect for effect, _, modelled in listed("leto-2020") if not modelled}
    assert "spectrum" in lacking
    assert {"blaze", "stray_light"}.isdisjoint(lacking)


TRUST = (
    "twin: {of: leto-aged, photographs: 59, pictures: 8, gap: {wirtinger: 1.0}, light: [0.05], "
    "flattery: 3.2, flattery_error: 0.4}"
)


def test_a_display_that_is_like_a_twin_is_none(tmp_path: Path) -> None:
    (tmp_path / "lab.yaml").write_text(f"like: ideal\nname: lab\n{TRUST}\n")
    (tmp_path / "changed.yaml").write_text("like: lab.yaml\nname: changed\nflicker: {rms: 0.1}\n")
    assert "more than 3 dB" in load_profile("lab.yaml", tmp_path).twin.words
    assert load_profile("changed.yaml", tmp_path).twin == Trust()


@pytest.mark.parametrize(
    ("old", "new"), [("0.4", "-0.4"), ("59", "-1"), ("3.2", "many"), ("1.0", "1000"), ("0.05", "-1")]
)
def test_impossible_figures_are_refused_at_their_place(tmp_path: Path, old: str, new: str) -> None:
    (tmp_path / "lab.yaml").write_text(f"like: ideal\nname: lab\n{TRUST.replace(old, new)}\n")
    with pytest.raises(UserError, match=r"lab\.yaml:3:\d+: "):
        load_profile("lab.yaml", tmp_path)
