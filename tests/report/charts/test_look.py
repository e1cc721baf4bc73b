"""Colours as people see them, by CIEDE2000 between the hues, to normal and colour-blind eyes and in gray; and media."""

import itertools

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from skimage.color import deltaE_ciede2000, rgb2lab

from holobench_eval.core import plugins
from holobench_eval.report.charts.look import (
    BLACK,
    HUES,
    MEDIA,
    NEUTRAL,
    REGISTRY,
    SCREEN,
    drawn_for,
    look,
    looks,
    medium,
)

# Machado, Oliveira & Fernandes, IEEE TVCG 15 (2009), severity 1, on linear RGB.
SEEN = {
    "normal": np.eye(3),
    "deuteranope": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "protanope": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "gray": [[0.2126, 0.7152, 0.0722]] * 3,  # luminance of sRGB primaries
}


def seen(colours, eye):
    """``(n, 3)`` sRGB values as an eye sees them."""
    values = np.array([to_rgb(colour) for colour in colours])
    linear = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    changed = np.clip(linear @ np.array(SEEN[eye]).T, 0, 1)
    return np.where(changed <= 0.0031308, 12.92 * changed, 1.055 * changed ** (1 / 2.4) - 0.055)


def nearest(colours, eye):
    """The smallest difference between two of some colours, CIEDE2000."""
    lab = rgb2lab(seen(colours, eye)[None])[0]
    return min(float(deltaE_ciede2000(a, b)) for a, b in itertools.combinations(lab, 2))


@pytest.mark.parametrize(("eye", "least"), [("normal", 20), ("deuteranope", 13), ("protanope", 11)])
def test_any_two_hues_are_told_apart_by_every_eye_and_from_the_neutral_ones(eye, least):
    assert nearest([*HUES, NEUTRAL, BLACK], eye) > least


def test_any_two_hues_differ_in_gray():
    assert nearest(HUES, "gray") > 5.9


def test_the_measure_finds_a_red_and_a_green_that_a_deuteranope_confuses():
    pair = ("#B05A00", "#7C7A00")
    assert nearest(pair, "normal") > 20
    assert nearest(pair, "deuteranope") < 8


def test_every_installed_method_has_a_colour_and_marker_of_its_own():
    assert set(plugins.names("methods")) <= set(REGISTRY)
    assert len(set(REGISTRY.values())) == len(REGISTRY)
    assert {colour for colour, _ in REGISTRY.values()} == {*HUES, BLACK}


def test_a_look_depends_on_the_method_and_not_on_its_label_or_place():
    some = looks({"ours": "hil", "theirs": "sgd"})
    others = looks({"a": "wirtinger", "b": "sgd", "c": "hil"})
    assert some["ours"] == others["c"]
    assert some["theirs"] == others["b"]


def test_variants_of_a_method_share_colour_and_marker_and_differ_in_their_faces():
    found = looks({"plain": "sgd", "short": "hil", "middle": "hil", "long": "hil"})
    variants = [found[label] for label in ("short", "middle", "long")]
    assert {(one.colour, one.marker) for one in variants} == {REGISTRY["hil"]}
    assert len({one.face for one in variants}) == 3
    assert found["short"].face == found["short"].colour
    assert found["plain"].face == found["plain"].colour


def test_a_method_of_a_file_is_neutral_and_looks_the_same_wherever_the_file_lies():
    assert look("mine.py:Mine") == look("some/folder/mine.py:Mine")
    assert look("mine.py:Mine").colour == NEUTRAL
    assert len({look(f"mine.py:Method{number}").marker for number in range(30)}) > 5


def test_figures_are_drawn_for_the_screen_unless_another_medium_is_asked_for():
    assert medium() is SCREEN
    with pytest.raises(KeyError, match="a block of 685"), drawn_for(MEDIA["double"]):
        raise KeyError(f"a block of {medium().width}")
    assert medium() is SCREEN


def test_words_are_wrapped_between_words_and_never_within():
    lines = SCREEN.wrap("double_phase_with_a_long_name and more", 90).splitlines()
    assert lines == ["double_phase_with_a_long_name", "and more"]
