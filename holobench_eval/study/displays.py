"""The calls a study makes on displays, all in one place."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import torch

from ..core.device import CPU
from ..core.errors import CellError, UserError

if TYPE_CHECKING:
    from ..display import CalibratedBench, Profile
    from ..display.api import DisplaySpec
    from ..display.simulated.changes import Value
    from ..lab.real import RealBench
    from .preparation import Preparation

Panel = tuple[int, int]
LEARNED = "learned"
"""How a config names the display that is a trained network."""
OPEN_PIXELS, OPEN_BENCHES = 8 * 1080 * 1920, 64
"""Pixels of all benches that a process keeps open, and their number, at most; but two are."""


@dataclass(frozen=True)
class Rig:
    """A real bench.

    bench: the file that describes it (None: it is described by a profile's panel); folder, session: the folder that
    photographs are exchanged in, and its name (none: the devices of the bench file take them).
    """

    bench: Path | None = None
    folder: Path | None = None
    session: str = ""


@dataclass(frozen=True)
class Condition:
    """A display that a study shows its methods on.

    source: the profile's name or path as the config gives it; folder: where a relative path starts; name,
    version, digest: those of the profile; spec: its nominal optics at the study's panel size; learned: what has to be
    prepared for a display that is a trained network (the other fields are those of the display it was trained on,
    except for its name); change: kind and value of what has changed on it since methods were prepared (None: nothing);
    real: where its photographs come from (None: it is simulated).
    """

    source: str
    folder: Path
    name: str
    version: int
    digest: str
    spec: DisplaySpec
    learned: Preparation | None = None
    change: tuple[str, Value] | None = None
    real: Rig | None = None

    @property
    def nominal(self) -> Condition:
        """The display before the change."""
        return replace(self, change=None)

    @property
    def title(self) -> str:
        """Its name in tables, with the change."""
        return self.name if self.change is None else f"{self.name}, {change_text(*self.change)}"


def change_text(kind: str, value: Value) -> str:
    """A change in words: ``drift 30 days``."""
    from ..display.simulated.changes import KINDS

    shown = f"{value:.10g}" if isinstance(value, float) else value
    return " ".join(part for part in (kind.replace("_", " "), shown, KINDS[kind].unit) if part)


def condition(source: str, panel: Panel | None, folder: Path) -> Condition:
    """Read a profile without building its bench. UserError: unknown profile, or a panel it cannot have."""
    from ..display import load_profile

    profile = load_profile(source, folder=folder)
    return Condition(source, folder, profile.name, profile.version, profile.digest, profile.spec(panel))


def real_condition(source: str, folder: Path) -> Condition:
    """Read the file of a real bench without opening its devices. UserError for a file that is none."""
    from ..lab.bench_file import load_bench_file

    path = folder / source
    bench = load_bench_file(path)
    spec = bench.panel.spec(bench.name)
    return Condition(source, folder, bench.name, bench.version, bench.digest, spec, real=Rig(bench=path))


def workbench(shown: Condition, seed: int, device: torch.device = CPU) -> CalibratedBench | RealBench:
    """The bench of a condition, built and calibrated once in a process; a simulated one is computed on ``device``.

    CellError when its calibration cannot be trusted; that too is found out once, not for every cell.
    """
    place = None if shown.real else device  # a real one is opened once, whoever computes
    key = (shown.source, shown.folder, shown.digest, shown.spec.shape, shown.change, shown.real, seed, place)
    if key not in _open:
        _open[key] = _opened(shown, seed, device)
        pixels = shown.spec.shape[0] * shown.spec.shape[1]
        while len(_open) > max(2, min(OPEN_BENCHES, OPEN_PIXELS // pixels)):
            _open.popitem(last=False)
    _open.move_to_end(key)
    opened = _open[key]
    if isinstance(opened, CellError):
        raise CellError(str(opened)) from opened
    return opened


_open: OrderedDict[object, CalibratedBench | RealBench | CellError] = OrderedDict()
"""Those used least recently come first."""


def simulated(shown: Condition, seed: int, device: torch.device = CPU) -> CalibratedBench:
    """``workbench`` of a display that does not exist."""
    from ..display import CalibratedBench

    opened = workbench(shown, seed, device)
    assert isinstance(opened, CalibratedBench)
    return opened


def forget_sessions() -> None:
    """Open the benches behind session folders anew when they are next asked for: their files may have changed."""
    for key in [key for key, bench in _open.items() if not isinstance(bench, CellError) and bench.is_real]:
        del _open[key]


def open_bench(
    profile: Profile,
    panel: Panel | None = None,
    seed: int = 0,
    registered_as: CalibratedBench | None = None,
    device: torch.device = CPU,
) -> CalibratedBench:
    """The simulated bench of a profile on a panel of (rows, columns) pixels; ``seed`` names its noise.

    registered_as: see ``CalibratedBench``; device: see ``SimulatedBench``.
    """
    from ..display import CalibratedBench
    from ..display.simulated.pipeline import SimulatedBench
    from ..methods.fiducials import fiducial_phases

    bench = SimulatedBench(profile.scaled(panel), device)
    return CalibratedBench(bench, seed, fiducial_phases, registered_as)


def _opened(shown: Condition, seed: int, device: torch.device) -> CalibratedBench | RealBench | CellError:
    if shown.real is not None:
        from ..lab.opening import open_real

        return open_real(shown, shown.real, seed)
    from ..display import load_profile
    from ..display.simulated.changes import KINDS, altered

    profile = load_profile(shown.source, folder=shown.folder)
    if profile.digest != shown.digest:
        raise UserError(f"profile '{shown.source}' has changed since the study was planned; start the run again")
    unmoved = None
    try:
        if shown.change is not None:
            if not KINDS[shown.change[0]].moves:
                unmoved = simulated(shown.nominal, seed, device)
            profile = altered(profile, *shown.change)
        opened = open_bench(profile, shown.spec.shape, seed, unmoved, device)
        _ = opened.registration  # calibrated now, so that no method's time includes it
    except CellError as error:
        return error
    return opened
