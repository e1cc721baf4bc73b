"""From a task to its records: solve, show, photograph, score. This is what a worker runs."""

from __future__ import annotations

import math
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import torch
from torch import Tensor

from .. import registry
from ..config import Save
from ..errors import CellError
from ..metrics import floor_captures, match, score
from ..seeds import seed
from . import timings
from .bench import Condition, workbench
from .images import write_capture, write_phase, write_thumbnail
from .plan import Cell, Task
from .store import Record, Store, file_name, write_atomically

MOST_SATURATED = 0.001
"""Largest fraction of saturated samples with which a capture is scored (protocol v1, step 1)."""

Measure = Callable[[Cell, Condition], Record]


@dataclass(frozen=True)
class Setting:
    """What a worker needs to know of a run besides its task.

    output: the study's output folder; folder: the config's folder, where relative paths start; threads:
    torch threads of a worker; workers: tasks computed side by side; retime: measure wall times again, see
    ``timings``.
    """

    output: Path
    folder: Path
    save: Save
    lpips_weights: str | None
    threads: int
    workers: int
    retime: bool = False


@dataclass(frozen=True)
class Job:
    """A task, the cells of it that are wanted, and the setting of the run."""

    task: Task
    wanted: frozenset[str]
    setting: Setting

    @property
    def cells(self) -> list[tuple[Cell, Condition]]:
        """The wanted cells and their displays."""
        pairs = zip(self.task.cells, self.task.conditions, strict=True)
        return [(cell, place) for cell, place in pairs if cell.id in self.wanted]

    def failed(self, cell: Cell, error: BaseException) -> Record:
        """The record of a cell that has no score, with the reason in one line."""
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:300]
        label = cell.method if self.task.is_floor else self.task.label
        return Record(cell.description(), "failed", label, reason)


def work(job: Job) -> list[Record]:
    """Compute and write the wanted records of a task. A failure of a cell becomes a failed record, never an error."""
    with _repeatable(job.setting.threads):
        try:
            measure = _floor(job) if job.task.is_floor else _solution(job)
        except (Exception, SystemExit) as error:
            return [_note_failure(job, cell, error) for cell, _ in job.cells]
        return [_recorded(job, cell, place, measure) for cell, place in job.cells]


def _recorded(job: Job, cell: Cell, place: Condition, measure: Measure) -> Record:
    store = Store(job.setting.output)
    try:
        record = measure(cell, place)
        for name, value in record.scores.items():
            if not math.isfinite(value):
                raise CellError(f"the score {name} is {value}")
        store.write(record)
    except Exception as error:
        return _note_failure(job, cell, error)
    store.log(cell.id).unlink(missing_ok=True)
    return record


def _note_failure(job: Job, cell: Cell, error: BaseException) -> Record:
    store, record = Store(job.setting.output), job.failed(cell, error)
    store.write(record)
    write_atomically(store.log(cell.id), "".join(traceback.format_exception(error)).encode())
    return record


def _solution(job: Job) -> Measure:
    """Solve the task's target on its first display; the result shows the phase on any of its displays."""
    task, setting = job.task, job.setting
    first, place = task.cells[0], task.conditions[0]
    method = registry.build("methods", first.method, dict(first.params), setting.folder)
    target = _target(first, place, setting.folder)
    bench = workbench(place, first.seed)
    handle = bench.for_method(method, task.label, target, item=first.target, repeat=first.repeat)
    given = target[None].clone()  # what a method does to its target must not reach the score
    started = time.perf_counter()
    solved = method.solve(given, handle)
    elapsed = time.perf_counter() - started
    if not isinstance(solved, Tensor) or tuple(solved.shape[:2]) != tuple(given.shape[:2]):
        found = tuple(solved.shape) if isinstance(solved, Tensor) else type(solved).__name__
        raise CellError(f"{task.label}: solve returned {found}, not a phase ({given.shape[0]}, {given.shape[1]}, H, W)")
    phase = solved.detach().cpu()[0]
    seconds = timings.keep(timings.key(task, setting.threads, setting.workers), elapsed, setting.retime)

    def show(cell: Cell, place: Condition) -> Record:
        shot = workbench(place, cell.seed).photograph(
            phase, target, item=cell.target, repeat=cell.repeat, exposure=cell.exposure, label=task.label
        )
        if shot.saturated > MOST_SATURATED:
            raise CellError(f"{shot.saturated:.2%} of the capture is saturated, more than {MOST_SATURATED:.1%}")
        _save(job, cell, shot.image, phase)
        scores = score(shot.image, target, lpips_weights=setting.lpips_weights)
        write_thumbnail(Store(setting.output).thumbnail(cell.id), match(shot.image, target)[0])
        return Record(
            cell=cell.description(),
            state="done",
            label=task.label,
            scores=scores | {"efficiency": shot.efficiency},
            captures=handle.captures,
            seconds=seconds,
            registration_residual_px=shot.residual,
            saturated=shot.saturated,
        )

    return show


def _floor(job: Job) -> Measure:
    """What images that no display made score on the task's target."""
    setting, cells, place = job.setting, job.task.cells, job.task.conditions[0]
    target = _target(cells[0], place, setting.folder)
    others = [_target(replace(cell, **cell.params), place, setting.folder) for cell in cells if cell.params]
    captures = floor_captures(target, others, cells[0].seed, cells[0].target)
    write_thumbnail(Store(setting.output).target_thumbnail(cells[0].target), target)

    def reference(cell: Cell, _: Condition) -> Record:
        scores = score(captures[cell.method], target, lpips_weights=setting.lpips_weights)
        return Record(cell.description(), "done", cell.method, scores=scores)

    return reference


def _target(cell: Cell, place: Condition, folder: Path) -> Tensor:
    """The target at the size of the scored region, ``(C, h, w)`` linear light in [0, 1]."""
    dataset = registry.build("datasets", cell.dataset, dict(cell.dataset_params), folder)
    if dataset.digest(cell.target) != cell.target_sha256:
        raise CellError(f"target '{cell.target}' has changed since the study was planned; start the run again")
    target: Tensor = dataset.load(cell.target, place.spec.region.shape, channels=len(place.spec.wavelengths))
    return target


def _save(job: Job, cell: Cell, image: Tensor, phase: Tensor) -> None:
    setting = job.setting
    name = file_name(cell.target) + (f"-{cell.repeat}" if cell.repeat else "") + ".png"
    place = Path(file_name(job.task.label), file_name(cell.condition), name)
    if setting.save.captures:
        write_capture(setting.output / "captures" / place, image)
    if setting.save.phases:
        write_phase(setting.output / "phases" / place, phase)


@contextmanager
def _repeatable(threads: int) -> Iterator[None]:
    """The same numbers for the same input: threads as asked for, operations without a deterministic form refused."""
    before = torch.get_num_threads(), torch.are_deterministic_algorithms_enabled()
    torch.set_default_dtype(torch.float32)  # a method's file may have changed these two for everybody
    torch.set_grad_enabled(True)
    torch.manual_seed(seed("global random numbers"))
    torch.set_num_threads(threads)
    torch.use_deterministic_algorithms(True)
    # Filling fresh memory guards against reading it too early; it would be timed with the methods.
    torch.utils.deterministic.fill_uninitialized_memory = False  # type: ignore[attr-defined]
    try:
        yield
    finally:
        torch.set_num_threads(before[0])
        torch.use_deterministic_algorithms(before[1])
