"""What ``holoeval calibrate`` fits of a profile and to what: a YAML file in this folder, named after the profile."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any

from annotated_types import MinLen

from ...core.errors import UserError
from ...core.schema import typed
from ...core.yaml_source import load
from ...display import Profile, load_profile
from ...display.simulated.stages import Panel
from ..definition import Targets


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
    return sorted(entry.name.removesuffix(".yaml") for entry in _folder().iterdir() if entry.name.endswith(".yaml"))


def load_calibration(profile: Profile) -> Calibration:
    """The calibration of a profile: of its name, or of the one that it is like if its name is that one's and a suffix.

    Other profiles like it are other displays, whose parameters mean something else; and so is one of another panel,
    for which nobody published the figures. UserError: it has none.
    """
    for name in names():
        if profile.name == name or (profile.like == name and profile.name.startswith(f"{name}-")):
            _refuse_another_panel(profile, load_profile(name))
            return typed(load(_folder() / f"{name}.yaml"), Calibration)
    raise UserError(f"profile '{profile.name}' is not fitted to anything; {_right()}")


def refuse_bench_file(path: Path) -> None:
    """UserError for the file of a real bench, which is no profile; a file that is no YAML is left to others."""
    if path.suffix.lower() not in (".yaml", ".yml") or not path.is_file():
        return
    kinds = ("slm", "camera", "phase", "capture", "laser")
    if any(key in load(path).data for key in kinds):
        raise UserError(
            f"{path}: describes a real bench, and calibrate fits profiles of simulated displays; {_right()}"
        )


def _refuse_another_panel(profile: Profile, shipped: Profile) -> None:
    pairs = (
        (entry.name, getattr(profile.panel, entry.name), getattr(shipped.panel, entry.name)) for entry in fields(Panel)
    )
    for key, own, wanted in pairs:
        if own != wanted:
            raise UserError(
                f"profile '{profile.name}': panel.{key} is {own}, and the figures that calibrate fits are of "
                f"'{shipped.name}', where it is {wanted}; {_right()}"
            )


def _right() -> str:
    return (
        f"calibrate takes {' or '.join(names())}, or a profile of the same panel that is like one of them and has its "
        "name with a suffix; a study with the method parametric_model estimates what a display of your own does"
    )


def _folder() -> Path:
    return Path(str(files(__package__)))
