"""The calls a study makes on displays, all in one place."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import CellError, UserError

if TYPE_CHECKING:
    from ..display import Workbench
    from ..display.contract import DisplaySpec
    from .preparation import Preparation

Panel = tuple[int, int]
LEARNED = "learned"
"""How a config names the display that is a trained network."""


@dataclass(frozen=True)
class Condition:
    """A display that a study shows its methods on.

    source: the profile's name or path as the config gives it; folder: where a relative path starts; name,
    version, digest: those of the profile; spec: its nominal optics at the study's panel size; learned: what has to be
    prepared for a display that is a trained network (the other fields are those of the display it was trained on,
    except for its name).
    """

    source: str
    folder: Path
    name: str
    version: int
    digest: str
    spec: DisplaySpec
    learned: Preparation | None = None


def condition(source: str, panel: Panel | None, folder: Path) -> Condition:
    """Read a profile without building its bench. UserError: unknown profile, or a panel it cannot have."""
    from ..display import load_profile

    profile = load_profile(source, folder=folder)
    return Condition(source, folder, profile.name, profile.version, profile.digest, profile.spec(panel))


def workbench(shown: Condition, seed: int) -> Workbench:
    """The bench of a condition, built and calibrated once in a process.

    CellError when its calibration cannot be trusted; that too is found out once, not for every cell.
    """
    opened = _opened(shown.source, shown.folder, shown.digest, shown.spec.shape, seed)
    if isinstance(opened, CellError):
        raise CellError(str(opened)) from opened
    return opened


@lru_cache(maxsize=8)
def _opened(source: str, folder: Path, digest: str, panel: Panel, seed: int) -> Workbench | CellError:
    from ..display import load_profile, open_bench

    profile = load_profile(source, folder=folder)
    if profile.digest != digest:
        raise UserError(f"profile '{source}' has changed since the study was planned; start the run again")
    opened = open_bench(profile, panel=panel, seed=seed)
    try:
        _ = opened.registration  # calibrated now, so that no method's time includes it
    except CellError as error:
        return error
    return opened
