"""Open a real bench: the folder of a session, or its devices."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from ..core.errors import UserError
from ..display.simulated.profile import load_profile
from .bench_file import load_bench_file
from .real import RealBench

if TYPE_CHECKING:
    from ..study.displays import Condition, Rig
    from .session import FolderPhotographer


def open_real(shown: Condition, rig: Rig, seed: int) -> RealBench:
    """The bench of a condition; its devices are opened once in a process. UserError for a file that has changed."""
    if rig.bench is not None:
        bench = load_bench_file(rig.bench)
        found, panel, bound = bench.digest, bench.panel, bench.residual_bound
    else:
        profile = load_profile(shown.source, folder=shown.folder).scaled(shown.spec.shape)
        found, panel, bound = profile.digest, profile.panel, profile.residual_bound
    if found != shown.digest:
        raise UserError(f"'{shown.source}' has changed since the study was planned; start the run again")
    if rig.folder is not None:
        return RealBench(shown.spec, session_photographer(rig.folder), panel.blaze, bound, seed)
    from .live import open_live

    assert rig.bench is not None
    return open_live(load_bench_file(rig.bench), rig.bench.parent, seed)


@lru_cache(maxsize=1)
def session_photographer(folder: Path) -> FolderPhotographer:
    """The photographer of a session folder, one for a process: what it notes is written at the end of a run."""
    from .session import FolderPhotographer

    return FolderPhotographer(folder)
