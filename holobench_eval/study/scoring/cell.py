"""From a task to its records: solve, show, photograph, score. This is what a worker runs."""

from __future__ import annotations

import math
import traceback
from collections.abc import Mapping
from dataclasses import replace
from functools import partial

from ...core.device import repeatable
from ...core.errors import CellError, Pending, StopError
from ...core.io import write_atomically
from ..displays import Condition
from ..plan import Cell
from ..store import Record
from . import error_budget, focus, picture, prediction
from .job import Job, Measure, Measured
from .reference import guarded
from .scores import is_kept

MEASURES: Mapping[str, tuple[Measure, Measure]] = {  # of solutions and of floor images, by the config's ``measure``
    "picture": (picture.picture, picture.floor),
    "prediction": (prediction.prediction, prediction.floor),
    "error_budget": (error_budget.error_budget, prediction.floor),
    "focus": (focus.focus, picture.floor),
    "views": (focus.views, picture.floor),
}

QUICK = 0.1  # s of a solution; to wait for the disk, so that a record outlives a loss of power, takes some milliseconds


def work(job: Job) -> list[Record]:
    """Compute and write the wanted records of a task. A failure of a cell becomes a failed record, never an error.

    A cell that waits for a photograph (``Pending``) gets no record. One that lacks a score alone is scored from its
    kept capture; where none is kept, or the score needs more captures, its phase is photographed again.
    """
    metrics = job.setting.metrics
    with repeatable(job.setting.threads, job.device):
        kept, rest = list[tuple[Cell, Condition]](), list[tuple[Cell, Condition]]()
        for cell, display in job.cells:
            is_rescored = cell.id in job.unscored and is_kept(cell, job.store, metrics)
            (kept if is_rescored else rest).append((cell, display))
        records = [_recorded(job, *pair, partial(picture.rescored, job)) for pair in kept]
        records += _captured(job, rest) if rest else []
        return [record for record in records if record is not None]


def _captured(job: Job, cells: list[tuple[Cell, Condition]]) -> list[Record | None]:
    try:
        measured = _measured(job)
    except StopError:
        raise
    except Pending:
        return []
    except (Exception, SystemExit) as error:
        return [_note_failure(job, cell, error) for cell, _ in cells]
    return [_recorded(job, *pair, partial(_added, job, measured)) for pair in cells]


def _added(job: Job, measured: Measured, cell: Cell, display: Condition) -> Record:
    """The record of a cell; of one that lacked a score alone, its record with the scores that it lacked."""
    record = measured(cell, display)
    before = job.store.read(cell.id) if cell.id in job.unscored else None
    if before is None or _training(before) != _training(record):
        return record
    again = 0 if record.reused else record.captures  # its phase was not kept
    return replace(before, scores=before.scores | record.scores, captures=before.captures + again)


def _training(record: Record) -> str:
    return str((record.learned or {}).get("sha256", ""))


def _measured(job: Job) -> Measured:
    first = job.task.cells[0]
    solving, floor = MEASURES[first.measure]
    if job.task.is_floor:
        return floor(job)
    with guarded(first.method, job.setting.study, job.task.conditions[0]):
        return solving(job)


def _recorded(job: Job, cell: Cell, display: Condition, measured: Measured) -> Record | None:
    """The record; None for a cell that waits for a photograph."""
    try:
        record = measured(cell, display)
        for name, value in record.values().items():
            if not math.isfinite(value):
                raise CellError(f"the score {name} is {value}")
        is_quick = display.real is None and (record.seconds or 0) < QUICK
        job.store.write(record, lasting=not is_quick)
    except StopError:
        raise
    except Pending:
        return None
    except Exception as error:
        return _note_failure(job, cell, error)
    job.store.log(cell.id).unlink(missing_ok=True)
    return record


def _note_failure(job: Job, cell: Cell, error: BaseException) -> Record:
    record, text = job.failed(cell, error), "".join(traceback.format_exception(error))
    job.store.write(record)
    write_atomically(job.store.log(cell.id), text.encode("utf-8", "backslashreplace"))
    return record
