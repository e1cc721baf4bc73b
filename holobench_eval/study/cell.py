"""From a task to its records: solve, show, photograph, score. This is what a worker runs."""

from __future__ import annotations

import math
import traceback

from ..core.errors import CellError, LostDeviceError, Pending
from ..core.io import write_atomically
from . import focus
from .displays import Condition
from .job import Job, repeatable
from .plan import Cell
from .scoring import Measure, floor, picture, prediction
from .store import Record, Store

MEASURES = {"picture": picture, "prediction": prediction, "focus": focus.focus}
FLOORS = {"picture": floor, "prediction": floor, "focus": focus.floor}


def work(job: Job) -> list[Record]:
    """Compute and write the wanted records of a task. A failure of a cell becomes a failed record, never an error.

    A cell that waits for a photograph (``Pending``) gets no record.
    """
    with repeatable(job.setting.threads, job.device):
        try:
            measure = (FLOORS if job.task.is_floor else MEASURES)[job.task.cells[0].measure](job)
        except LostDeviceError:
            raise
        except Pending:
            return []
        except (Exception, SystemExit) as error:
            return [_note_failure(job, cell, error) for cell, _ in job.cells]
        recorded = [_recorded(job, cell, place, measure) for cell, place in job.cells]
        return [record for record in recorded if record is not None]


def _recorded(job: Job, cell: Cell, place: Condition, measure: Measure) -> Record | None:
    """The record; None for a cell that waits for a photograph."""
    store = Store(job.setting.output)
    try:
        record = measure(cell, place)
        for name, value in record.scores.items():
            if not math.isfinite(value):
                raise CellError(f"the score {name} is {value}")
        store.write(record)
    except LostDeviceError:
        raise
    except Pending:
        return None
    except Exception as error:
        return _note_failure(job, cell, error)
    store.log(cell.id).unlink(missing_ok=True)
    return record


def _note_failure(job: Job, cell: Cell, error: BaseException) -> Record:
    store, record = Store(job.setting.output), job.failed(cell, error)
    store.write(record)
    write_atomically(store.log(cell.id), "".join(traceback.format_exception(error)).encode())
    return record
