"""What a study compares, in words: pictures with targets, or predictions with captures; on a bench or on a network.

A report has one frame for all of them. A number that says how well a capture was predicted must never read as if it
said how good a picture is, so everything that differs is here, side by side.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from ..core.errors import listed
from ..study.definition import Study
from ..study.folders import FILES as FILES
from .statistics import Estimate

K = TypeVar("K")
V = TypeVar("V")


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
    """``a``, ``a and b``, ``a, b and c``; ``a, x; and b`` where a name holds a comma."""
    return listed(names, "and")


def grouped(pairs: Iterable[tuple[K, V]]) -> dict[K, list[V]]:
    """The values of each key, in the order of the pairs: what has one text is told together."""
    found: dict[K, list[V]] = {}
    for key, value in pairs:
        found.setdefault(key, []).append(value)
    return found


def number(value: float | None) -> str:
    """Four significant digits at most, no exponent for everyday sizes; a dash for NaN and None."""
    if value is None or math.isnan(value):
        return "–"
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def sample(estimate: Estimate, total: int) -> str:
    """``28 of 28 targets in 15 clusters``."""
    among = f" in {estimate.clusters} clusters" if estimate.clusters != estimate.n else ""
    return f"{estimate.n} of {total} targets{among}"


def bracketed(estimate: Estimate | None, form: str, scale: float = 1.0, unit: str = "") -> str:
    """A mean with its interval, where there is one, scaled and as numbers of a form; a dash for None and NaN. unit: of
    the mean."""
    if estimate is None or math.isnan(estimate.mean):
        return f"–{unit if estimate else ''}"
    mean, low, high = (f"{scale * value:{form}}" for value in (estimate.mean, estimate.low, estimate.high))
    return f"{mean}{unit} [{low}, {high}]" if estimate.has_interval else f"{mean}{unit}"


def percent(estimate: Estimate | None) -> str:
    """A share in percent."""
    return bracketed(estimate, "z.0f", 100)


@dataclass(frozen=True)
class Text:
    """The words of one kind of study.

    scored, truth: what is scored, and what it is compared with, in the singular; axis: added to the headline metric in
    figures; each: what a method makes for one target; procedure: what is done; caution: what the figures do not say;
    displays: what the displays are; compared: in which values pictures are matched; picture: what a tile of a
    picture is.
    """

    scored: str = "capture"
    truth: str = "target"
    axis: str = ""
    each: str = "hologram"
    procedure: str = (
        "A method turns a target image into a phase pattern. The pattern is shown on a display, the display's image is "
        "captured, the capture is registered to the target, matched in intensity and scored."
    )
    caution: str = ""
    displays: str = (
        "The displays are simulated benches. Listed are the nominal optics, which methods know, and the stages that "
        "differ from an ideal bench, whose values, in the profile, methods do not know."
    )
    compared: str = "in linear light"
    picture: str = "Each capture is registered, matched in intensity and sRGB-encoded"


ON_A_NETWORK = Text(
    scored="predicted capture",
    procedure=(
        "A method turns a target image into a phase pattern. No display shows it: a trained, frozen network predicts "
        "its capture, and the prediction is matched in intensity and scored."
    ),
    caution=(
        "The scores measure how well a method exploits the network, which may predict what no display would show. "
        "Whether a bench shows the same is a question for another study."
    ),
    displays="The display is a trained, frozen network; there is no bench and no noise.",
    picture="Each predicted capture is matched in intensity and sRGB-encoded",
)

PREDICTION = Text(
    scored="prediction",
    truth="capture",
    axis=", of predictions against captures",
    each="prediction",
    procedure=(
        "Trained methods predict the capture of a phase pattern. The patterns are holograms of the targets by "
        "{holograms}, the same for all methods. Each pattern is shown on the display, captured, and registered to its "
        "target. A method receives the pattern; its prediction is matched in intensity to the capture and scored "
        "against it."
    ),
    caution=(
        "A high score means that the capture was predicted, flaws included. It does not measure picture quality: no "
        "method's own holograms are shown."
    ),
    picture=(
        'The column "target" shows the capture of the hologram by {holograms}, registered and matched to the target; '
        "each prediction is matched to it in intensity; all are sRGB-encoded"
    ),
)


FOCUS = Text(
    procedure=(
        "The targets are focal stacks: pictures of a scene with depth, focused on one plane after another, with "
        "depth-of-field blur. A method turns the picture of a plane into a phase pattern for the display's own "
        "distance. The display adds the phase of a lens, which moves the picture to its plane; the camera stands there "
        "and is registered anew (dynamic global focus). A method that makes one hologram of all planes of a scene "
        "receives all their pictures; no lens is added, and the camera moves from plane to plane. A capture is matched "
        'in intensity over the whole picture and scored. Scores "in focus" cover what is in focus at its plane.'
    ),
    caution="Targets of one scene are not independent: intervals and tests are over scenes.",
    picture="Each capture is taken at the plane of its target, registered, matched in intensity and sRGB-encoded",
)


VIEWS = Text(
    procedure=(
        "The targets are light fields: what an eye sees of a scene with depth whose pupil is at one place of the "
        "eyebox after another. A method makes one hologram of a scene: from all views that it is given, or, if it "
        "knows of none, from the one nearest to the axis. The display shows it to a pupil at each scored place, which "
        "may lie between those of given views; the capture is matched in intensity and scored against the view from "
        "there."
    ),
    caution="Views of one scene are not independent: intervals and tests are over scenes.",
    picture="Each capture is what the eye sees from the place of its target, matched in intensity and sRGB-encoded",
)


COMPARED = {
    "stored": "in the values as stored",
    "srgb": "in linear light, for which captures and targets were decoded from sRGB",
    "linear": "in linear light, for which targets were decoded from sRGB and captures taken as they are",
}

GIVEN = Text(
    procedure=(
        "Photographs of a display and their target pictures were given as files; how the photographs were taken and "
        'processed is unknown. No fiducials were photographed; "Alignment" says how each target was located in its '
        "capture. A capture is matched in intensity and scored on the pixels of its target."
    ),
    picture="Each capture is aligned with its target and matched in intensity",
)


AS_STORED = (
    "Values as stored: the numbers in the files over their full scale, without decoding. If the pictures are sRGB, as "
    "most are, equal differences of values are not equal differences of light: do not compare these scores with those "
    "in linear light. Perceptual metrics take the values as display-encoded, as they are defined."
)
REAL = (
    "The display is a real bench. Listed are its nominal optics, which methods know; its deviations from them are "
    "unknown."
)
BY_MEASURE = {
    "picture": Text(),
    "prediction": PREDICTION,
    "error_budget": PREDICTION,
    "focus": FOCUS,
    "views": VIEWS,
    FILES: GIVEN,
}


def text_of(study: Study, on_a_network: bool) -> Text:
    """The words of a study. on_a_network: whether its display is a trained network."""
    text = ON_A_NETWORK if on_a_network and study.measure == "picture" else BY_MEASURE[study.measure]
    if study.measure == FILES:
        values = str(study.targets.params["values"])
        text = replace(text, compared=COMPARED[values], caution=AS_STORED if values == "stored" else text.caution)
    if study.display.real:
        text = replace(text, displays=REAL)
    name = study.holograms.name
    procedure, picture = (words.replace("{holograms}", name) for words in (text.procedure, text.picture))
    return replace(text, procedure=procedure, picture=picture)
