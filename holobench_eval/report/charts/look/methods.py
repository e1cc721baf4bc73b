"""The colour and marker of every method, equal in every figure of every study.

A hue is a family of methods, a marker a method in it, a tint a variant of a method within a study. The hues were
searched by chance for the largest smallest difference (CIEDE2000, Sharma, Wu & Dalal, Color Res. Appl. 30, 2005) to
normal eyes, to deuteranopes and protanopes (simulated as in Machado, Oliveira & Fernandes, IEEE TVCG 15, 2009) and in
gray; ``tests/report/charts/test_look.py`` measures them. No hue is used twice: a method that is not in the registry is
gray, with a marker of its own as far as there are markers, and charts write its name beside it.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from matplotlib.colors import to_hex, to_rgb

NAVY, ORANGE, GREEN, MAGENTA = "#002E6B", "#D56615", "#238655", "#B82686"
AMBER, SKY, VIOLET, CRIMSON = "#F4A610", "#0BA4D9", "#431CFC", "#861323"
HUES = (NAVY, ORANGE, GREEN, MAGENTA, AMBER, SKY, VIOLET, CRIMSON)
BLACK, WHITE = "#000000", "#FFFFFF"
NEUTRAL = "#888888"  # of methods that are not in the registry
PALEST = 0.85  # share of white in the face of a method's last variant
MARKERS = "osD^v<>PXp*"

REGISTRY = {
    "wirtinger": (NAVY, "o"),
    "wirtinger_gamma": (NAVY, "s"),
    "wirtinger_veil": (NAVY, "P"),
    "double_phase": (AMBER, "^"),
    "double_phase_aa": (AMBER, "v"),
    "double_phase_bl": (AMBER, "<"),
    "double_phase_gamma": (AMBER, ">"),
    "gerchberg_saxton": (CRIMSON, "s"),
    "hio": (CRIMSON, "D"),
    "multi_plane": (CRIMSON, "p"),
    "sgd": (SKY, "D"),
    "odak_sgd": (SKY, "o"),
    "torchoptics_adam": (SKY, "s"),
    "nearest_level": (NAVY, "^"),
    "straight_through": (SKY, "P"),
    "gumbel": (SKY, "*"),
    "random_frames": (SKY, "p"),
    "light_field": (SKY, "X"),
    "focal_stack": (SKY, "h"),
    "partially_coherent": (SKY, "v"),
    "hil": (MAGENTA, "P"),
    "hil_tuned": (MAGENTA, "X"),
    "hil_nh3d": (MAGENTA, "p"),
    "hil_plus": (ORANGE, "*"),
    "hil_terms": (MAGENTA, "*"),
    "parametric_model": (GREEN, "s"),
    "partially_coherent_model": (GREEN, "P"),
    "hybrid_model": (GREEN, "D"),
    "twin": (GREEN, "*"),
    "learned_kernel": (GREEN, "^"),
    "cnn_prop_cnn": (GREEN, "v"),
    "image_terms": (GREEN, "<"),
    "image_network": (GREEN, ">"),
    "field_network": (GREEN, "o"),
    "holonet": (ORANGE, "o"),
    "ccnn": (ORANGE, "s"),
    "tensor_holography": (ORANGE, "D"),
    "unet_phase": (ORANGE, "^"),
    "online_camera": (VIOLET, "D"),
    "online_camera_network": (VIOLET, "s"),
    "phases": (SKY, "^"),
    "oracle": (BLACK, "D"),
    "through": (NAVY, "D"),
}


@dataclass(frozen=True)
class Look:
    """How a method is drawn: a marker, its colour (``#RRGGBB``, of lines and edges too) and that of its face."""

    colour: str
    marker: str
    face: str


def look(name: str, variant: int = 0, variants: int = 1) -> Look:
    """The look of a method by its registered name, or by ``path/to/file.py:Name``, of which the class counts.

    variant, variants: which of how many rows of the method it is; later ones have paler faces.
    """
    chance = hashlib.sha256(name.rpartition(":")[2].encode()).digest()[0]  # depends on the name alone
    colour, marker = REGISTRY.get(name, (NEUTRAL, MARKERS[chance % len(MARKERS)]))
    if name == "oracle":
        return Look(colour, marker, WHITE)
    pale = PALEST * variant / (variants - 1) if variants > 1 else 0.0
    return Look(colour, marker, _paler(colour, pale))


def _paler(colour: str, white: float) -> str:
    """A colour mixed with a share of white."""
    red, green, blue = (share + white * (1 - share) for share in to_rgb(colour))
    return to_hex((red, green, blue)).upper()


def looks(names: Mapping[str, str]) -> dict[str, Look]:
    """The look of every row of a study. names: the registered name of each label, in the order of the config."""
    variants, seen, found = Counter(names.values()), Counter[str](), {}
    for label, name in names.items():
        found[label] = look(name, seen[name], variants[name])
        seen[name] += 1
    return found
