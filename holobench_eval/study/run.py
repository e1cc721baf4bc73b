"""Run what is missing of a study."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from . import provenance
from .artifacts import Artifacts
from .available import refuse_unavailable
from .cell import work
from .executors import Executor
from .job import Job, Setting
from .plan import Plan, Task
from .store import Record, Store
from .training import TrainingJob, train

if TYPE_CHECKING:
    from ..config import Study


class Watch(Protocol):
    """Sees a run's progress."""

    def planned(self, cells: int, missing: int) -> None:
        """The run begins: cells of the study, and those that have to be computed."""
        ...

    def training(self, names: list[tuple[str, Path]]) -> None:
        """Training begins: label and artifact folder, where ``training.csv`` grows, of everything to be trained."""
        ...

    def trained(self, name: str, failure: str) -> None:
        """A training ended; failure: why it failed, empty if it did not."""
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
    artifacts: Path,
    retry_failed: bool = False,
    retime: bool = False,
    retrain: bool = False,
) -> Outcome:
    """Train what is not trained, compute the missing cells of a plan and write their records.

    artifacts: folder of what methods learned; retry_failed: compute failed cells again; retime: measure wall times
    again (see ``timings``); retrain: train again, and compute again what depends on it.
    UserError: the folder is in use by another run, or holds a damaged record. An interrupt passes through;
    every record written before it stays, and the next run goes on from there.
    """
    store = Store(output)
    with store.locked():
        if retrain:
            forget(plan, store, Artifacts(artifacts))
        missing = frozenset(cell.id for cell in store.missing(plan.cells, retry_failed))
        refuse_unavailable(plan, missing, study.folder)
        watch.planned(len(plan.cells), len(missing))
        described = provenance.read(output)
        if missing or not described:
            described = provenance.describe(study, plan, output, threads, executor.workers)
            described = provenance.begin(output, described, resumed=len(missing) < len(plan.cells))
        setting = Setting(
            output=output,
            folder=study.folder,
            artifacts=artifacts,
            save=study.save,
            lpips_weights=study.protocol.lpips_weights,
            threads=threads,
            workers=executor.workers,
            retime=retime,
        )
        if missing:  # else no worker need be started
            prepare(plan, missing, setting, executor, watch)
            for job, result in executor.map(work, _jobs(plan, missing, setting, watch)):
                watch.finished(_lost(job, result, store) if isinstance(result, Exception) else result)
            described = provenance.end(output, described)
        return Outcome(store.load(plan), described, len(missing))


def forget(plan: Plan, store: Store, artifacts: Artifacts) -> None:
    """Remove what was learned for a plan, and the records that depend on it."""
    for needed in plan.preparations().values():
        artifacts.remove(needed)
    for cell in plan.cells:
        if cell.prepared:
            store.path(cell.id).unlink(missing_ok=True)


def prepare(plan: Plan, missing: frozenset[str], setting: Setting, executor: Executor, watch: Watch) -> None:
    """Train what missing cells need and is not there; check what is there before anything is computed with it."""
    wanted = {identity for cell in plan.cells if cell.id in missing for identity in cell.prepared}
    artifacts, waiting = Artifacts(setting.artifacts), []
    for needed in plan.preparations().values():
        if needed.id in wanted:
            if artifacts.has(needed):
                artifacts.load(needed)
            else:
                waiting.append(needed)
    if not waiting:
        return
    watch.training([(needed.name, artifacts.place(needed)) for needed in waiting])
    jobs = (TrainingJob(needed, setting.artifacts, setting.threads) for needed in waiting)
    for job, failure in executor.map(train, jobs):
        reason = artifacts.fail(job.needed, failure) if isinstance(failure, Exception) else failure
        watch.trained(job.needed.name, reason)


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
