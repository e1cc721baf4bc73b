"""What a study compares, in words: pictures with targets, or predictions with captures; on a bench or on a network.

A report has one frame for all of them. A number that says how well a capture was predicted must never read as if it
said how good a picture is, so everything that differs is here, side by side.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

FILES = "files"  # the measure of pictures that were given as files


def plain(values: Mapping[str, Any]) -> str:
    """``a = 1, b = [2, 3]``: parameters as text on one line."""
    return ", ".join(f"{key} = {_value(value)}" for key, value in values.items()) or "none"


def _value(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, Mapping):
        return f"({plain(value)})"
    return "none" if value is None else str(value)


def words(names: list[str]) -> str:
    """``a``, ``a and b``, ``a, b and c``."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def number(value: float) -> str:
    """Four significant digits at most, no exponent for everyday sizes; a dash for NaN."""
    return "–" if math.isnan(value) else f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def p_value(p: float) -> str:
    """``p = 0.031`` or ``p < 0.001``."""
    return "p < 0.001" if p < 0.001 else f"p = {p:.3f}"


@dataclass(frozen=True)
class Text:
    """The words of one kind of study.

    scored, truth: what is scored, and what it is compared with, in the singular; axis: added to the headline metric in
    figures; each: what a method makes for one target. best, only: how the first of several, or the only, ranked method
    is introduced; other: the same for another metric. procedure: what is done; caution: what the figures do not say;
    displays: what the displays are; floor, instead: the reference images and the heading of their column. looked_at:
    heading of the pictures; picture: what a tile of the comparison is. geometry, blur, effort: first sentences of these
    sections. seeds: what is random. compared: in which values pictures are matched and blurred; domains: what the
    domains of metrics mean.
    """

    scored: str = "capture"
    truth: str = "target"
    axis: str = ""
    each: str = "hologram"
    best: str = "Best of the {count} ranked methods"
    only: str = "The only ranked method"
    other: str = "By {metrics} the best is {label}, not {best}."
    procedure: str = (
        "A method turns a target image into a phase pattern. The pattern is shown on a display, the display's image is "
        "captured, the capture is registered to the target, matched in intensity and scored."
    )
    caution: str = ""
    displays: str = (
        "The displays are simulated benches. Listed are the nominal optics, which methods know, and each stage of the "
        "bench that differs from an ideal one, which they do not, with the parameters of the profile file."
    )
    floor: str = (
        "The same targets, scored against images that no method made, through the same intensity match and metrics."
    )
    instead: str = "shown instead of a capture"
    compared: str = "in linear light"
    domains: str = (
        "Linear: light intensity in [0, 1], as the sensor measures it. Amplitude: its square root. sRGB: as a monitor "
        "would be given it; perceptual metrics are defined there."
    )
    looked_at: str = "Captures to look at"
    picture: str = "Each capture is registered, matched in intensity and sRGB-encoded"
    geometry: str = (
        'Registration is frozen before any method\'s image is seen. "Refined" lets each capture move rigidly by at '
        "most 2 px and 0.1 degree, found by correlation and never by maximising the score; a large difference means "
        "that the geometry drifted."
    )
    blur: str = "Methods that trade speckle for sharpness can change places."
    effort: str = "Captures are camera captures that a method used to solve one target."
    seeds: str = (
        "The noise of a capture depends on target, display and repeat and not on the method, so all methods meet the "
        "same noise and differences are paired."
    )

    def floor_name(self, name: str) -> str:
        """What a floor row shows."""
        wrong = "the wrong target" if self.truth == "target" else f"the {self.truth} of the wrong target"
        return {
            "floor_constant": "a constant image",
            "floor_black": "a black image",
            "floor_speckle": "pure speckle",
            "floor_wrong_target": wrong,
            "floor_mirrored": f"the mirrored {self.truth}",
            "floor_shift_1px": f"the {self.truth} shifted by 1 px",
        }[name]


PICTURE = Text()

ON_A_NETWORK = replace(
    PICTURE,
    scored="predicted capture",
    procedure=(
        "A method turns a target image into a phase pattern. No display shows it: what a trained, frozen network "
        "predicts of its capture is matched in intensity and scored."
    ),
    caution=(
        "The scores say how well a method exploits the network, which may expect what no display would show. What a "
        "bench makes of the same holograms is another study."
    ),
    displays="The display is a trained network, held as it is; there is no bench, no camera and no noise.",
    instead="in the place of a predicted capture",
    looked_at="Predicted captures to look at",
    picture="Each predicted capture is matched in intensity and sRGB-encoded",
    geometry=(
        'The network predicts in the frame of the target. "Refined" lets each predicted capture move rigidly by at '
        "most 2 px and 0.1 degree, found by correlation and never by maximising the score; a large difference means "
        "that the picture is displaced."
    ),
    effort="There is no camera, so that no method captures anything while it solves.",
    seeds="A learned display has no noise, so that repeats differ by the methods' own random numbers alone.",
)

PREDICTION = replace(
    PICTURE,
    scored="prediction",
    truth="capture",
    axis=", of predictions against captures",
    each="prediction",
    best="Of the {count} ranked methods the captures are predicted most closely by",
    only="The only ranked method",
    other="By {metrics} the closest predictions are those of {label}, not of {best}.",
    procedure=(
        "Here trained methods predict what a camera captures of a phase pattern. The patterns are holograms of the "
        "targets by {holograms}, the same for all methods. Each is shown on the display and captured, and the capture "
        "is registered to its target. A method is given the phase pattern; its prediction is matched in intensity to "
        "the capture and scored against the capture."
    ),
    caution=(
        "A high score means that the capture was foreseen, flaws included. It says nothing about how good a picture "
        "is, and no method's own holograms are shown."
    ),
    floor="The same captures, scored against images that no method predicted, through the same match and metrics.",
    instead="in the place of a prediction",
    looked_at="Predictions to look at",
    picture=(
        'In the column "capture" stands what was captured of the hologram by {holograms}, registered and matched to '
        "the target; each prediction is matched in intensity to it; all are sRGB-encoded"
    ),
    geometry=(
        'Captures are registered before anything is predicted. "Refined" lets each prediction move rigidly by at most '
        "2 px and 0.1 degree, found by correlation and never by maximising the score; a large difference means that "
        "predictions are displaced."
    ),
    blur="Predictions that leave out speckle can change places with those that show it.",
    effort="A prediction takes no captures.",
    seeds=(
        "The noise of a capture depends on target, display and repeat and not on the method, so all methods predict "
        "the same captures and differences are paired."
    ),
)


FOCUS = replace(
    PICTURE,
    procedure=(
        "The targets are focal stacks: a scene with depth as an eye sees it that focuses on one plane after another, "
        "with depth-of-field blur. A method turns the picture of a plane into a phase pattern for the display's own "
        "distance; the display adds the phase of a lens, which moves the picture to its plane, and the camera stands "
        "there and is registered anew (dynamic global focus). A method that makes one hologram of all planes of a "
        "scene is given all their pictures; no lens is added, and the camera goes from plane to plane. A capture is "
        'matched in intensity over the whole picture and scored; scores "in focus" are of what is in focus at its '
        "plane."
    ),
    caution="Targets of one scene are not independent, so that intervals and tests over targets are too narrow.",
    picture="Each capture is taken at the plane of its target, registered, matched in intensity and sRGB-encoded",
    effort=(
        "Captures are camera captures that a method used for one hologram, and seconds are those of one hologram: of "
        "one plane, or of all planes of a scene for a method that makes one of them."
    ),
)


_COMPARED = {
    "stored": "in the values as stored",
    "srgb": "in linear light, for which captures and targets were decoded from sRGB",
    "linear": "in linear light, for which targets were decoded from sRGB and captures taken as they are",
}

GIVEN = replace(
    PICTURE,
    best="Of the {count} methods with a capture of every target the best is",
    only="The only method with a capture of every target",
    procedure=(
        "Photographs of a display and the pictures that it was to show were given as files; what made the photographs, "
        "and what was done to them afterwards, is not known. No fiducials were photographed: the geometry comes from "
        "the pictures themselves, each capture being aligned with its target. On the pixels of its target a capture is "
        "matched in intensity and scored."
    ),
    floor="The same targets, scored against images that nobody photographed, through the same match and metrics.",
    picture="Each capture is aligned with its target and matched in intensity",
    geometry=(
        '"Refined" lets each aligned capture move rigidly by at most 2 px and 0.1 degree, found by correlation and '
        "never by maximising the score; a large difference means that the common alignment does not fit the capture."
    ),
    effort="What the captures cost to make is not known.",
    seeds="Nothing is random but the speckle of the floor, which depends on the target's name alone.",
)


AS_STORED = (
    "Values as stored: the numbers in the files over their full scale, without any decoding. If the pictures are sRGB, "
    "as most are, equal differences of values are not equal differences of light, and these scores must not stand "
    "beside those in linear light. Perceptual metrics take the values for display-encoded pictures, as they are "
    "defined."
)
REAL = (
    "The display is a real bench that was photographed. Listed are its nominal optics, which methods know; what "
    "separates it from them nobody knows."
)
REAL_SEEDS = (
    "The noise of a photograph is the camera's own, so that the same study photographed again gives other numbers; "
    "methods are shown in mixed order, so that a slow drift favours none."
)


_BY_MEASURE = {"picture": PICTURE, "prediction": PREDICTION, "focus": FOCUS, FILES: GIVEN}


def text_of(
    measure: str, holograms: str = "", on_a_network: bool = False, real: bool = False, values: str = "stored"
) -> Text:
    """The words for a measure.

    holograms: the method whose captures are predicted; real: whether the display exists; values: how pictures were read
    that were given as files.
    """
    text = ON_A_NETWORK if on_a_network and measure == "picture" else _BY_MEASURE[measure]
    if measure == FILES:
        text = replace(text, compared=_COMPARED[values], domains=AS_STORED if values == "stored" else text.domains)
    if real:
        text = replace(text, displays=REAL, seeds=REAL_SEEDS)
    procedure, picture = (words.replace("{holograms}", holograms) for words in (text.procedure, text.picture))
    return replace(text, procedure=procedure, picture=picture)
