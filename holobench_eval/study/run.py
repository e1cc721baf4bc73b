"""Run what is missing of a study."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from . import provenance
from .cell import Job, Setting, work
from .executors import Executor
from .plan import Plan, Task
from .store import Record, Store

if TYPE_CHECKING:
    from ..config import Study


class Watch(Protocol):
    """Sees a run's progress."""

    def planned(self, cells: int, missing: int) -> None:
        """The run begins: cells of the study, and those that have to be computed."""
        ...

    def started(self, task: Task) -> None:
        """A task is taken up."""
        ...

    def finished(self, records: list[Record]) -> None:
        """A task's cells have their records."""
        ...


@dataclass(frozen=True)
class Outcome:
    """What a run leaves: a record for every planned cell (``Store.load``), its provenance, and what it computed."""

    records: list[dict[str, Any]]
    provenance: dict[str, Any]
    computed: int

    @property
    def failed(self) -> int:
        """Cells without a score."""
        return sum(record["state"] == "failed" for record in self.records)


def run(
    study: Study,
    plan: Plan,
    output: Path,
    executor: Executor,
    watch: Watch,
    threads: int,
    retry_failed: bool = False,
    retime: bool = False,
) -> Outcome:
    """Compute the missing cells of a plan and write their records.

    retry_failed: compute failed cells again; retime: measure wall times again (see ``timings``).
    UserError: the folder is in use by another run, or holds a damaged record. An interrupt passes through;
    every record written before it stays, and the next run goes on from there.
    """
    store = Store(output)
    with store.locked():
        missing = frozenset(cell.id for cell in store.missing(plan.cells, retry_failed))
        watch.planned(len(plan.cells), len(missing))
        described = provenance.read(output)
        if missing or not described:
            described = provenance.describe(study, plan, output, threads, executor.workers)
            described = provenance.begin(output, described, resumed=len(missing) < len(plan.cells))
        setting = Setting(
            output=output,
            folder=study.folder,
            save=study.save,
            lpips_weights=study.protocol.lpips_weights,
            threads=threads,
            workers=executor.workers,
            retime=retime,
        )
        for job, result in executor.map(work, _jobs(plan, missing, setting, watch)):
            watch.finished(_lost(job, result, store) if isinstance(result, Exception) else result)
        if missing:
            described = provenance.end(output, described)
        return Outcome(store.load(plan), described, len(missing))


def _jobs(plan: Plan, missing: frozenset[str], setting: Setting, watch: Watch) -> Iterator[Job]:
    """The tasks with missing cells; the watch is told of each when an executor takes it."""
    for task in plan.tasks:
        wanted = missing.intersection(cell.id for cell in task.cells)
        if wanted:
            watch.started(task)
            yield Job(task, wanted, setting)


def _lost(job: Job, error: Exception, store: Store) -> list[Record]:
    """Failed records of a job whose worker was lost."""
    records = [job.failed(cell, error) for cell, _ in job.cells]
    for record in records:
        store.write(record)
    return records
