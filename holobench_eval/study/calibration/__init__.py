"""What ``holoeval calibrate`` fits of a profile and to what: a YAML file in this folder, named after the profile."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import reduce
from pathlib import Path
from typing import Annotated, Any

from annotated_types import MinLen
from torch import Tensor

from ...core import plugins
from ...core.errors import UserError
from ...core.schema import typed
from ...core.yaml_source import load
from ...display import CalibratedBench, Profile, load_profile
from ...display.simulated.stages import Panel
from ..definition import Targets

FOLDER = Path(__file__).parent


@dataclass(frozen=True)
class Prediction:
    """How well a network predicts captures from their ideal intensity.

    psnr: mean [dB]; parameter: the free one that decides it; tolerance: how far from their figures captures may be [dB]
    for its sake; study: a study with the measure ``prediction`` and one method, without display and targets, which are
    those of the calibration.
    """

    psnr: float
    parameter: str
    tolerance: float
    study: Mapping[str, Any]


@dataclass(frozen=True)
class Calibration:
    """What is fitted and to what.

    panel: rows and columns [px]; seed: of patterns and noise; targets: the images; figures: PSNR [dB] of captures in
    linear light, by method; free: the range of every free parameter, ``stage.key`` of the profile.
    """

    panel: tuple[int, int]
    seed: int
    targets: Targets
    figures: Annotated[Mapping[str, float], MinLen(1)]
    free: Annotated[Mapping[str, tuple[float, float]], MinLen(1)]
    prediction: Prediction | None = None


def names() -> list[str]:
    """Profiles that have a calibration."""
    return sorted(path.stem for path in FOLDER.glob("*.yaml"))


def load_calibration(profile: Profile) -> Calibration:
    """The calibration of a profile: of its name, or of the one that it is like if its name is that one's and a suffix.

    Other profiles like it are other displays, whose parameters mean something else; and so is one of another panel,
    for which nobody published the figures. UserError: it has none.
    """
    like = profile.like or ""
    name = like if profile.name.startswith(f"{like}-") else profile.name
    if name not in names():
        drawn = f"; --draws draws the family of {name}" if (FOLDER / "families" / f"{name}.yaml").exists() else ""
        raise UserError(f"profile '{profile.name}' is not fitted to anything{drawn}; {_right()}")
    shipped = load_profile(name)
    for entry in fields(Panel):
        own, wanted = (getattr(panel, entry.name) for panel in (profile.panel, shipped.panel))
        if own != wanted:
            published = f"the figures that calibrate fits are of '{name}', where it is {wanted}"
            raise UserError(f"profile '{profile.name}': panel.{entry.name} is {own}, and {published}; {_right()}")
    return typed(load(FOLDER / f"{name}.yaml"), Calibration)


def _right() -> str:
    return (
        f"calibrate takes {' or '.join(names())}, or a profile of the same panel that is like one of them and has its "
        "name with a suffix; a study with the method parametric_model estimates what a display of your own does"
    )


def value_of(profile: Profile, name: str) -> Any:
    """A profile's value of a parameter, by ``stage.key``; 0 for a key of a mapping that it does not give."""
    value: Any = profile
    for key in name.split("."):
        value = value.get(key, 0.0) if isinstance(value, Mapping) else getattr(value, key)
    return value


def with_values(profile: Profile, values: Mapping[str, Any]) -> Profile:
    """A profile with other values of some parameters, by ``stage.key``; a number stands for all colours."""
    for name, value in values.items():
        profile = _put(profile, name.split("."), value)
    return profile


def nested(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values by ``stage.key`` as the file of a profile has them."""
    document: dict[str, Any] = {}
    for name, value in values.items():
        *holders, key = name.split(".")
        inner = reduce(lambda holder, part: holder.setdefault(part, {}), holders, document)
        inner[key] = list(value) if isinstance(value, tuple) else value
    return document


def _put(holder: Any, path: list[str], value: Any) -> Any:
    """What holds a parameter, with another value of it; a number stands for all colours."""
    first, *rest = path
    is_class = is_dataclass(holder)
    if is_class and first not in {field.name for field in fields(holder)}:
        raise UserError(f"{type(holder).__name__} has no parameter '{first}'")
    old = getattr(holder, first) if is_class else holder.get(first, 0.0)
    if rest:
        new = _put(old, rest, value)
    elif isinstance(old, tuple):
        new = tuple(value) if isinstance(value, list | tuple) else (value,) * len(old)
    else:
        new = round(value) if isinstance(old, int) and not isinstance(old, bool) else value
    return replace(holder, **{first: new}) if is_class else {**holder, first: new}


def hologram(method: str, bench: CalibratedBench, target: Tensor, item: str) -> Tensor:
    """The phase ``(C, H, W)`` [rad] of an image, by a method with its defaults; it knows the nominal optics alone."""
    built = plugins.build("methods", method, {})
    phase: Tensor = built.solve(target[None], bench.for_method(built, method, target, item, 0))[0]
    return phase
