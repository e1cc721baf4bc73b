"""Run what is missing of a study."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ...core.device import find, gpu_name
from ...core.errors import StopError, UserError
from ...core.errors import reason as one_line
from ...core.hashing import canonical, digest
from ...display.traits import traits_of
from ...metrics import catalogue
from .. import cost, identity, isolation
from ..artifacts import Artifacts
from ..definition import Study
from ..displays import Preparation
from ..executors import Executor, Serial
from ..executors.clusters import Address
from ..executors.local import Local
from ..executors.remaining import Kind, Remaining
from ..phases import Phases, phases_of
from ..plan import Cell, Plan
from ..scoring import starts
from ..scoring.cell import work
from ..scoring.job import Job, Setting
from ..scoring.scores import is_kept
from ..store import Record, Store, appears, late
from ..training import TrainingJob, train
from . import provenance
from .progress import Lines
from .queue import Drawing, Queue, Step

Result = str | list[Record] | None  # of a training the reason of its failure, empty for success; of a task its records


@dataclass(frozen=True)
class Outcome:
    """A record for every planned cell (``Store.load``), the run's provenance, and the numbers of cells that were
    computed, of those whose phase was solved in this run, of those that were captured before and scored now, and of
    those that lack a score which nothing kept can give."""

    records: list[dict[str, Any]]
    provenance: dict[str, Any]
    computed: int
    solved: int = 0
    rescored: int = 0
    unscored: int = 0

    @property
    def failed(self) -> int:
        """Cells without a score."""
        return sum(record["state"] == "failed" for record in self.records)


def run(
    study: Study,
    plan: Plan,
    output: Path,
    executor: Executor,
    watch: Lines,
    threads: int,
    artifacts: Path,
    retry_failed: bool = False,
    retrain: bool = False,
    trains: bool = True,
    device: str = "cpu",
    drawings: Sequence[Drawing] = (),
    rescore: Collection[str] = (),
) -> Outcome:
    """Train what is not trained, compute the missing cells of a plan and write their records.

    An interrupt passes through; earlier records stay, and the next run resumes.

    Parameters
    ----------
    study, plan
        See ``config.load_study`` and ``plan.plan``.
    output
        Folder of the study's records and report.
    executor
        Where tasks are computed, see ``executors.executor``.
    watch
        Sees the progress.
    threads
        Torch threads of a worker.
    artifacts
        Folder of what methods learned.
    retry_failed
        Compute failed cells again.
    retrain
        Train again, and compute the dependent cells again.
    trains
        Whether what is not trained may be.
    device
        Name of where every worker computes, see ``device.find``.
    drawings
        Called by workers that would otherwise wait for the last cells; a failure is the caller's to see.
    rescore
        Only score by these metrics what was captured before and lacks them; solve nothing.

    Returns
    -------
    Outcome
        A record for every planned cell, and the provenance of the run.

    Raises
    ------
    UserError
        The folder is in use by another run, or holds a damaged record.
    """
    store, learned = Store(output), Artifacts(artifacts)
    with store.locked():
        if retrain:
            forget(study, plan, store, learned)
        metrics = {name: plan.metrics[name] for name in rescore or plan.metrics}
        left = _left(study, plan, store, learned, metrics, retry_failed, solves=not rescore)
        _refuse(study, plan, left, learned, trains)
        store.remove(left.outdated)  # at once, so that a run that is killed does not take them for new
        watch.planned(len(plan.cells), len(left.wanted), plan.floors)
        setting = Setting(replace(study), output, artifacts, metrics, threads, executor.workers, device)
        described = _begun(setting, plan, left, executor)
        # With nothing to do no worker need be started.
        solved = _compute(plan, left, setting, executor, watch, drawings) if left.wanted else 0
        if described.get("ended") is None:
            described = provenance.end(output, described)
        again = [record for record in map(store.read, left.unscored) if record and record.state == "done"]
        unscored = sum(bool(identity.lacking(record.scores, metrics)) for record in again)
        rescored = len(again) - unscored
        return Outcome(store.load(plan), described, len(left.missing), solved, rescored, unscored)


def _begun(setting: Setting, plan: Plan, left: _Left, executor: Executor) -> dict[str, Any]:
    """The provenance, written as a run begins that computes something or has another config; else that from before."""
    study, output, described = setting.study, setting.output, provenance.read(setting.output)
    if left.missing or described.get("config_sha256") != provenance.text_digest(study.text):
        is_here = isinstance(executor, Serial | Local)  # else the GPU is another machine's
        gpu = gpu_name(find(setting.device)) if is_here else ""
        described = provenance.describe(study, plan, output, setting.threads, setting.workers, setting.device, gpu)
        return provenance.begin(output, described, resumed=len(left.missing) < len(plan.cells))
    return provenance.restate(output, study, plan) if left.scorable else described


@dataclass(frozen=True)
class _Left:
    """The cells of a plan that are left, by id.

    missing: to be computed; outdated: whose records hold no longer; unscored: captured, and lacking a score alone;
    scorable: those of them that can be scored again; timed: to be solved with nothing beside it.
    """

    missing: frozenset[str]
    outdated: frozenset[str]
    unscored: Mapping[str, Cell]
    scorable: frozenset[str]
    timed: frozenset[str]

    @property
    def wanted(self) -> frozenset[str]:
        """Those that a run can do something about."""
        return self.missing | self.scorable


def _left(
    study: Study,
    plan: Plan,
    store: Store,
    artifacts: Artifacts,
    metrics: Mapping[str, str],
    retry_failed: bool,
    solves: bool,
) -> _Left:
    """What is left of a plan. metrics: versions of those that are wanted; solves: whether anything may be solved."""
    phases, timed = phases_of(store.output, study.folder, study.part), cost.timed(study, plan)
    networks = artifacts.networks(plan.preparations().values())
    states = store.states(plan.cells, timed, metrics, study.folder, networks)
    again = ("missing", "untimed", *(("failed",) if retry_failed else ()))
    missing = frozenset(name for name, state in states.items() if state in again and solves)
    missing, outdated = starts.affected(plan, missing, states, phases)
    unscored = {cell.id: cell for cell in plan.cells if states[cell.id] == "unscored" and cell.id not in missing}
    scorable = (name for name, cell in unscored.items() if _is_scorable(cell, store, phases, metrics, solves))
    return _Left(missing, outdated, unscored, frozenset(scorable), timed)


def _is_scorable(cell: Cell, store: Store, phases: Phases, metrics: Mapping[str, str], solves: bool) -> bool:
    """Whether a captured cell can be scored again: from its kept capture, or on a display that is no real one from its
    phase, since a real photograph is never taken again for a metric. metrics: versions of those that are wanted;
    solves: whether a phase may be solved again."""
    if is_kept(cell, store, metrics):
        return True
    if cell.shown_on is not None and cell.shown_on.real:
        return False
    if solves:
        return True
    if not cell.code:  # a floor image: of the target alone, or compared with the capture of a hologram
        return not cell.holograms or phases.read(digest(cell.holograms["phase"])) is not None
    return phases.read(cell.phase_id, learned=None) is not None


def _compute(
    plan: Plan, left: _Left, setting: Setting, executor: Executor, watch: Lines, drawings: Sequence[Drawing]
) -> int:
    """Train what the missing cells still need, then compute and score. Returns how many phases were solved."""
    artifacts, store = Artifacts(setting.artifacts), Store(setting.output)
    trainings = [TrainingJob(preparation, setting) for preparation in _announced(plan, left, artifacts, watch)]
    single = executor.workers == 1 and not isinstance(executor, Address)  # whose workers come and go
    jobs = list(_jobs(plan, left, single, setting))
    if single:  # one of each method first, so that the time left is known soon
        first = {job.task.label: job for job in reversed(jobs)}
        jobs.sort(key=lambda job: first[job.task.label] is not job)
    known = _known(jobs) if isinstance(executor, Serial | Local) else {}  # else other machines compute
    remaining = Remaining(((job.kind, job.alone) for job in jobs), known, executor.workers)
    watch.expects(remaining.seconds, remaining.is_whole)
    queue = Queue(trainings, jobs, left.missing, drawings)
    results: Iterator[tuple[Step, Result | Exception]] = executor.map(step, _watched(queue, remaining, watch))
    solved = 0
    for job, result in results:
        if isinstance(result, StopError):
            raise result
        if isinstance(job, TrainingJob):
            queue.ends(job, {job.preparation.id})
            reason = result if isinstance(result, str) else artifacts.fail(job.preparation, _error(result))
            watch.trained(job.preparation.name, reason)
        elif isinstance(job, Job):
            # Of several workers none should begin the longest job at the end.
            queue.ends(job, job.wanted, None if single else job.task.label)
            remaining.ends(id(job))
            records = result if isinstance(result, list) else _lost(job, _error(result), store)
            _refuse_unseen(records, store)
            own = [record for record in records if record.id in left.missing]
            solved += any(not record.reused and record.seconds is not None for record in own)
            watch.finished(records)
        else:
            queue.ends(job)
    return solved


def _announced(plan: Plan, left: _Left, artifacts: Artifacts, watch: Lines) -> list[Preparation]:
    """What has to be trained, after the watch was told."""
    untrained = _untrained(plan, left.missing, artifacts)
    if untrained:
        names = [(preparation.name, artifacts.folder_of(preparation)) for preparation in untrained]
        anew = {preparation.name: artifacts.outdated(preparation) for preparation in untrained}
        watch.training(names, [f"{name} is trained anew: {reason}" for name, reason in anew.items() if reason])
    return untrained


def forget(study: Study, plan: Plan, store: Store, artifacts: Artifacts) -> None:
    """Remove what was learned for a plan, and the phases and records that depend on it; not where all of it could not
    be computed again."""
    refuse_unscored(study)
    refuse_unavailable(plan, frozenset(cell.id for cell in plan.cells), study.folder)
    for preparation in plan.preparations().values():
        artifacts.remove(preparation)
    learned = [cell for cell in plan.cells if cell.prepared]
    phases_of(store.output, study.folder, study.part).remove(cell.phase_id for cell in learned)
    store.remove(cell.id for cell in learned)


def _refuse(study: Study, plan: Plan, left: _Left, artifacts: Artifacts, trains: bool) -> None:
    """UserError, in one line, where what is left cannot be computed here, or would be trained and may not be."""
    if left.wanted:
        refuse_unscored(study)
    refuse_unavailable(plan, left.missing, study.folder)
    for preparation in [] if trains else _untrained(plan, left.missing, artifacts):
        reason = artifacts.outdated(preparation) or f"{artifacts.folder} has nothing that it has learned"
        raise UserError(f"--no-train: {preparation.method} on {preparation.display.name} would be trained: {reason}")


def _untrained(plan: Plan, missing: frozenset[str], artifacts: Artifacts) -> list[Preparation]:
    """The missing artifacts that missing cells need; existing artifacts are checked before any computation."""
    wanted = {identity for cell in plan.cells if cell.id in missing for identity in cell.prepared}
    needed = [preparation for name, preparation in plan.preparations().items() if name in wanted]
    waiting = [preparation for preparation in needed if not artifacts.has(preparation)]
    for preparation in needed:
        if preparation not in waiting:
            artifacts.load(preparation)
    return waiting


def _jobs(plan: Plan, left: _Left, single: bool, setting: Setting) -> Iterator[Job]:
    """The tasks with cells to compute or to score; those that are timed, and of a ``single`` worker all, run alone."""
    for task in plan.tasks:
        ids = frozenset(cell.id for cell in task.cells)
        if wanted := ids & left.wanted:
            is_timed = not left.timed.isdisjoint(ids & left.missing)
            yield Job(task, wanted, setting, single or is_timed, is_timed, ids & left.scorable)


def _known(jobs: Iterable[Job]) -> dict[Kind, float]:
    """Seconds of the first solution of each kind, where it has been measured before."""
    first = {job.kind: job for job in reversed(list(jobs)) if not job.task.is_floor and job.wanted != job.unscored}
    measured = {kind: cost.recorded(job.timing) for kind, job in first.items()}
    return {kind: seconds for kind, seconds in measured.items() if seconds is not None}


def _watched(queue: Queue, remaining: Remaining, watch: Lines) -> Iterator[Step | None]:
    """The steps of a queue, which is told of each that an executor takes, as is the watch."""
    for job in queue:
        if job is not None:
            queue.begins(job)
        if isinstance(job, Job):
            remaining.begins(id(job), job.kind, job.alone)
            watch.started(job.task)
        yield job


def _refuse_unseen(records: list[Record], store: Store) -> None:
    """UserError for records that a worker wrote to a folder that this process does not see."""
    until = late()
    for record in records:
        if not appears(store.path(record.id), until):
            where = f"that is not in {store.folder.absolute()}; workers have to see this folder under the same name"
            raise UserError(f"a worker has written a record {where}")


def _error(result: Result | Exception) -> Exception:
    """The error of a job without a valid result."""
    return result if isinstance(result, Exception) else TypeError(f"a worker returned {type(result).__name__}")


def _lost(job: Job, error: Exception, store: Store) -> list[Record]:
    """Failed records of a job whose worker was lost."""
    records = [job.failed(cell, error) for cell, _ in job.cells]
    for record in records:
        store.write(record)
    return records


def step(job: Step) -> Result:
    """Carry out a training (see ``train``), the cells of a task (see ``work``) or a drawing. A worker runs this."""
    if isinstance(job, TrainingJob):
        return train(job)
    return work(job) if isinstance(job, Job) else job()


def refuse_unavailable(plan: Plan, missing: frozenset[str], folder: Path) -> None:
    """UserError, in one line, if a method of a missing cell says by ``available()`` that it cannot run here.

    Only methods of missing cells are asked: a report of records from elsewhere needs no method of its study.
    """
    wanted = [task for task in plan.tasks if not (task.is_floor or missing.isdisjoint(cell.id for cell in task.cells))]
    used = {canonical(list(each)): each for task in wanted for each in _used(task.cells[0])}
    for name, params in used.values():
        method = isolation.build(name, params, folder)
        if "available" not in traits_of(method, name).functions:
            continue
        try:
            reason = method.available()
        except Exception as error:  # a stranger's code
            reason = one_line(error)
        if reason:
            raise UserError(f"method '{name}' cannot run here: {reason}")


def refuse_unscored(study: Study) -> None:
    """UserError, in one line, if a metric of the study or of its headline cannot be computed here."""
    weights, wanted = study.protocol.lpips_weights, study.protocol.metrics or ()
    for metric in catalogue(None if weights is None else Path(weights)):
        if (metric.name in wanted or study.headline in metric.columns) and (reason := metric.available()):
            raise UserError(f"metric '{metric.name}' cannot be computed here: {reason}")


def _used(cell: Cell) -> list[tuple[str, dict[str, Any]]]:
    """Names and parameters of a cell's method and of the one whose holograms it predicts."""
    used = [(cell.method, dict(cell.params))]
    return [*used, (cell.holograms["name"], dict(cell.holograms["params"]))] if cell.holograms else used
