"""What a profile has is listed, and the display model's form names only effects that exist."""

from __future__ import annotations

from dataclasses import replace

from holobench_eval.commands.show import effects as listed
from holobench_eval.display import load_profile
from holobench_eval.display.simulated.profile import names
from holobench_eval.display.simulated.stages import Flicker, LookUpTable
from holobench_eval.methods.calibrated.display_model import FORM


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
