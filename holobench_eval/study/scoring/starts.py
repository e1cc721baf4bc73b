"""The phases that methods start from, and what has to be computed again with them."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path

from torch import Tensor

from ...core.errors import CellError
from ...core.hashing import digest
from ..phases import Phases, start_of
from ..plan import Cell, Plan
from ..store import MEASURED, appears, late
from .job import Job


def of(job: Job, cell: Cell) -> list[Tensor]:
    """The phases ``(C, H, W)`` [rad] that a cell starts from, those of its ``starts`` that have a score.

    CellError for a record or a phase that does not appear: no start may be left out unseen.
    """
    until, done = late(), list[str]()
    for identity in cell.starts:
        _seen(job.store.path(identity), until)
        record = job.store.read(identity)
        if record is not None and record.state == "done":
            done.append(digest(record.capture["phase"]))
    return [_read(job.phases, identity, until) for identity in dict.fromkeys(done)]


def content(found: Sequence[Tensor]) -> str:
    """The sha256 of starts, whatever their names; empty for none."""
    return hashlib.sha256(b"".join(phase.numpy().tobytes() for phase in found)).hexdigest() if found else ""


def _read(phases: Phases, identity: str, until: float) -> Tensor:
    path = _seen(phases.path(identity), until)
    solved = phases.read(identity, learned=None)
    if solved is None:
        raise CellError(f"{path}, from which this method starts, {phases.fault(identity)}")
    return start_of(solved.phase)


def _seen(file: Path, until: float) -> Path:
    """The file of a start; another machine may just have written it."""
    if not appears(file, until):
        raise CellError(f"{file} of a method to start from is not there; workers have to see this folder; run again")
    return file


def affected(
    plan: Plan, missing: frozenset[str], states: Mapping[str, str], phases: Phases
) -> tuple[frozenset[str], frozenset[str]]:
    """The cells to compute where those of ``missing`` have to be, and those whose records hold no longer, by id.

    A cell that starts from a missing one is computed again, since that one may have failed before; not so where that
    one has a score and is only timed again, for its phase stays. A start whose phase is not there as it was kept is
    computed again.
    """
    followers = [cell for cell in plan.cells if cell.starts]
    new = {identity for identity in missing if states[identity] not in MEASURED}
    outdated = frozenset(cell.id for cell in followers if not new.isdisjoint(cell.starts))
    computed = missing | outdated
    wanted = {identity for cell in followers if cell.id in computed for identity in cell.starts}
    by_id = {cell.id: cell.phase_id for cell in plan.cells}
    unkept = {name for name in wanted if states[name] in MEASURED and phases.read(by_id[name], learned=None) is None}
    return computed | unkept, outdated
