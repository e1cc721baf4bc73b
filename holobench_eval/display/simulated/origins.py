"""Where values of shipped profiles come from: figures that they were fitted to, or ranges that they were drawn from."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

from ...core.yaml_source import load
from .profile import PROFILES, Profile, load_profile

FITTED, RANGES = PROFILES / "fitted", PROFILES / "ranges"


def fit_of(profile: Profile) -> Mapping[str, Any] | None:
    """What free parameters of a profile were fitted to: of its name, or of the one that it is like if its name is that
    one's and a suffix; None for another panel than that of the published figures, and for all other displays."""
    like = profile.like or ""
    path = FITTED / f"{like if profile.name.startswith(f'{like}-') else profile.name}.yaml"
    return load(path).data if path.is_file() and profile.panel == load_profile(path.stem).panel else None


def families() -> list[str]:
    """The families that ship: of displays that are drawn from ranges."""
    return sorted(path.stem for path in RANGES.glob("*.yaml"))


@cache
def load_family(name: str) -> Mapping[str, Any]:
    """A family as its file describes it."""
    return load(RANGES / f"{name}.yaml").data


def parameters(family: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """What is drawn for the displays of a family, and for some: name, words, low, high, unit and source of each."""
    return [*family["parameters"], *family["outside"]["parameters"]]


def value_of(profile: Profile, name: str) -> Any:
    """A profile's value of a parameter, by ``stage.key``; 0 for a key of a mapping that it does not give."""
    value: Any = profile
    for key in name.split("."):
        value = value.get(key, 0.0) if isinstance(value, Mapping) else getattr(value, key)
    return value
