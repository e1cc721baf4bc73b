"""A task with everything that a worker needs to compute it."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from functools import lru_cache, reduce
from operator import or_
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from ...core import plugins
from ...core.device import find, gpu_name, moved
from ...core.errors import CellError, Pending, reason
from ...core.hashing import canonical
from ...core.reads import Seen, recorded
from ...datasets.base import digest_of
from ...display.learned import LearnedBench
from .. import cost, isolation, opening
from ..artifacts import FAILURE, Artifact, Artifacts
from ..definition import Study
from ..displays import Condition, Preparation
from ..isolation.reads import Reads, reads_of
from ..phases import Phases, phases_of
from ..plan import Cell, Task
from ..store import Record, State, Store
from ..versions import AGAIN, dataset_version, gate

TARGETS_KEPT = 16  # targets that a process keeps in memory; 25 MB each on a panel of 1080 x 1920 pixels

# Dataset, version of its code (empty for one that ships), parameters as JSON, folder of the config, name of the image
# and its digest.
TargetSource = tuple[str, str, str, Path, str, str]

Measured = Callable[[Cell, Condition], Record]  # makes the record of a cell on its display
Measure = Callable[["Job"], Measured]  # does the work that all cells of a job share


@dataclass(frozen=True)
class Setting:
    """The settings of a run that a worker needs besides its task.

    study: without what it has opened, since it goes to other processes; output: its output folder; artifacts: folder of
    what trained methods learned; metrics: versions of those to compute, by name; threads: torch threads of a worker;
    workers: tasks computed side by side; device: name of where a worker computes, see ``device.find``.
    """

    study: Study
    output: Path
    artifacts: Path
    metrics: Mapping[str, str]
    threads: int
    workers: int
    device: str


@dataclass(frozen=True)
class Job:
    """A task, the cells of it that are wanted, and the setting of the run.

    alone: whether it runs without concurrent workers; timed: whether it has to, so that its time can be compared;
    unscored: those of the wanted cells that were captured and lack a score alone.
    """

    task: Task
    wanted: frozenset[str]
    setting: Setting
    alone: bool
    timed: bool = False
    unscored: frozenset[str] = frozenset()

    @property
    def device(self) -> torch.device:
        """Where this worker computes. UserError for a GPU that is not there."""
        return find(self.setting.device)

    @property
    def store(self) -> Store:
        """Where its records are written."""
        return Store(self.setting.output)

    @property
    def phases(self) -> Phases:
        """Where phases are kept."""
        return phases_of(self.setting.output, self.setting.study.folder, self.setting.study.part)

    @property
    def kind(self) -> tuple[str, str]:
        """Method and display: jobs of a kind take about as long, and those that only score as any other such."""
        if self.wanted == self.unscored:
            return "scores", self.task.cells[0].condition
        return self.task.label, self.task.cells[0].condition

    @property
    def timing(self) -> str:
        """The name of its timing; a job that ran alone is named as in a run with one worker."""
        workers = 1 if self.alone else max(2, self.setting.workers)  # one on a cluster may be joined by others
        study = self.setting.study
        apart = not isolation.runs_inside(self.task.cells[0].method, study.folder, study.isolation)
        return cost.key(self.task, self.setting.threads, workers, gpu_name(self.device), apart)

    @property
    def cells(self) -> list[tuple[Cell, Condition]]:
        """The wanted cells and their displays."""
        pairs = zip(self.task.cells, self.task.conditions, strict=True)
        return [(cell, display) for cell, display in pairs if cell.id in self.wanted]

    def record(self, cell: Cell, state: State = "done", **further: Any) -> Record:
        """The record of a cell, with these further entries."""
        label = cell.method if self.task.is_floor else self.task.label
        if state == "done":
            reads = self.given_reads() | Reads(further.get("reads", {}), further.get("uncovered", ()))
            further |= {"reads": reads.covered, "uncovered": reads.uncovered}
        return Record(cell.description(), state, label, cell.condition, cell.target, **further)

    def failed(self, cell: Cell, error: BaseException) -> Record:
        """The record of a cell that has no score, with the reason in one line."""
        captures = self.phases.captures(self.task.cells[0].phase_id)
        return self.record(cell, "failed", reason=reason(error), captures=captures)

    def method(self, name: str, params: Any) -> Any:
        """An instance of a method, built anew: no cell may depend on those computed before."""
        study = self.setting.study
        return isolation.solver(name, params, study.folder, study.isolation, study.limits)

    def learned(self, preparation: Preparation | None) -> Artifact | None:
        """A method's learned state; None if it has nothing to learn. CellError when its training failed."""
        if preparation is None:
            return None
        artifacts = Artifacts(self.setting.artifacts)
        if not artifacts.has(preparation):
            if preparation.display.real and not (artifacts.folder_of(preparation) / FAILURE).is_file():
                raise Pending("its training waits for photographs")
            raise CellError(f"not trained: {artifacts.failure(preparation)}")
        return artifacts.load(preparation)

    def display(self, cell: Cell, display: Condition) -> opening.Bench:
        """The display of a cell: a simulated bench, a real one, or a trained network."""
        preparation, learned = display.learned, self.learned(display.learned)
        if preparation is None or learned is None:
            return opening.open_display(display, cell.seed, self.device)
        method = self.method(preparation.method, preparation.params)
        gate(method, preparation.method, preparation.version)
        return LearnedBench(display.spec, method, moved(learned.state, self.device), cell.seed, self.device)

    def source(self, cell: Cell) -> TargetSource:
        """Where the target of a cell comes from."""
        params = canonical(dict(cell.dataset_params))
        code = cell.phase["target"].get("code", "")
        return cell.dataset, code, params, self.setting.study.folder, cell.target, cell.target_sha256

    def target(self, cell: Cell, display: Condition) -> Tensor:
        """The target of a cell at the size of the scored region; see ``load_target``."""
        return load_target(self.source(cell), display)

    def given_reads(self) -> Reads:
        """What a user's dataset has read for the task's targets, and what the method's training took that is not
        covered."""
        reads = (_current(self.source(cell), self.task.conditions[0])[1] for cell in self.task.cells)
        learned = self.learned(self.task.preparation)
        return reduce(or_, reads, Reads(uncovered=tuple(learned.provenance.get("uncovered", ())) if learned else ()))


def load_target(source: TargetSource, display: Condition) -> Tensor:
    """A target at the size of the scored region, ``(C, h, w)`` linear light in [0, 1].

    CellError for a source that has changed since the study was planned.
    """
    return _current(source, display)[0].clone()


def _current(source: TargetSource, display: Condition) -> tuple[Tensor, Reads]:
    wanted = source, display.spec.region.shape, len(display.spec.wavelengths)
    if isolation.changed(_target(*wanted)[1].covered, source[3]):
        _target.cache_clear()
    return _target(*wanted)


@lru_cache(maxsize=TARGETS_KEPT)
def _target(source: TargetSource, shape: tuple[int, int], channels: int) -> tuple[Tensor, Reads]:
    """A target and what was read for it, loaded once in a process for all methods and repeats."""
    name, code, params, folder, item, sha256 = source
    with recorded() if code else nullcontext(Seen()) as seen:
        dataset = plugins.build("datasets", name, json.loads(params), folder)
        if dataset_version(name, type(dataset)) != code:
            raise CellError(f"the code of dataset '{name}' {AGAIN}")
        if digest_of(dataset, item) != sha256:
            raise CellError(f"target '{item}' {AGAIN}")
        target: Tensor = dataset.load(item, shape, channels=channels)
    if not target.any():
        raise CellError(f"target '{item}' is black; expected light in at least one of its colours")
    return target, reads_of(dataset, plugins.params_of, seen)
