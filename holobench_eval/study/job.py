"""A task with all that a worker needs to compute it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor

from ..core import plugins
from ..core.allocator import keep_freed_memory
from ..core.device import CPU, find, gpu_name, moved
from ..core.errors import CellError, Pending
from ..core.hashing import canonical
from ..core.seeds import seed
from . import timings
from .artifacts import Artifact, Artifacts
from .config import Save
from .displays import Condition, workbench
from .plan import Cell, Task
from .preparation import Preparation
from .store import Record

if TYPE_CHECKING:
    from ..display import CalibratedBench
    from ..display.learned import LearnedBench
    from ..lab.real import RealBench


@dataclass(frozen=True)
class Setting:
    """What a worker needs to know of a run besides its task.

    output: the study's output folder; folder: the config's folder, where relative paths start; artifacts: folder of
    what trained methods learned; metrics: names of those to compute (None: all); threads: torch threads of a worker;
    workers: tasks computed side by side; retime: measure wall times again, see ``timings``; device: name of where a
    worker computes, see ``device.find``.
    """

    output: Path
    folder: Path
    artifacts: Path
    save: Save
    metrics: tuple[str, ...] | None
    lpips_weights: str | None
    threads: int
    workers: int
    retime: bool = False
    device: str = "cpu"


@dataclass(frozen=True)
class Job:
    """A task, the cells of it that are wanted, and the setting of the run.

    alone: whether nothing else of the run is at work meanwhile, so that its time can be compared.
    """

    task: Task
    wanted: frozenset[str]
    setting: Setting
    alone: bool

    @property
    def device(self) -> torch.device:
        """Where this worker computes. UserError for a GPU that is not there."""
        return find(self.setting.device)

    @property
    def timing(self) -> str:
        """The name of its timing; what was measured alone serves a run with one worker, too."""
        workers = 1 if self.alone else max(2, self.setting.workers)  # one on a cluster may be joined by others
        return timings.key(self.task, self.setting.threads, workers, gpu_name(self.device))

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

    def learned(self, needed: Preparation | None) -> Artifact | None:
        """What a method learned; None if it had nothing to learn. CellError when its training failed."""
        if needed is None:
            return None
        artifacts = Artifacts(self.setting.artifacts)
        if not artifacts.has(needed):
            if needed.place.real and not artifacts.has_failed(needed):
                raise Pending("its training waits for photographs")
            raise CellError(f"not trained: {artifacts.failure(needed)}")
        return artifacts.load(needed)

    def bench(self, cell: Cell, place: Condition) -> CalibratedBench | RealBench | LearnedBench:
        """The display of a cell: a simulated bench, or a trained network."""
        learned = self.learned(place.learned)
        if place.learned is None or learned is None:
            return workbench(place, cell.seed, self.device)
        from ..display.learned import LearnedBench

        needed = place.learned
        method = plugins.build("methods", needed.method, dict(needed.params), needed.folder)
        return LearnedBench(place.spec, method, moved(learned.state, self.device), cell.seed, self.device)


def target_of(cell: Cell, place: Condition, folder: Path) -> Tensor:
    """The target at the size of the scored region, ``(C, h, w)`` linear light in [0, 1]."""
    dataset = plugins.build("datasets", cell.dataset, dict(cell.dataset_params), folder)
    if dataset.digest(cell.target) != cell.target_sha256:
        raise CellError(f"target '{cell.target}' has changed since the study was planned; start the run again")
    made = canonical([cell.dataset, dict(cell.dataset_params), str(folder), cell.target, cell.target_sha256])
    shape = place.spec.region.shape
    return _loaded(made, _Source(dataset), cell.target, shape, len(place.spec.wavelengths)).clone()


class _Source:
    """A dataset that ``_loaded`` does not tell from another: its other arguments do."""

    def __init__(self, dataset: Any) -> None:
        self.dataset = dataset

    def __hash__(self) -> int:
        return 0

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Source)


@lru_cache(maxsize=2)
def _loaded(made: str, source: _Source, item: str, shape: tuple[int, int], channels: int) -> Tensor:
    """A target, kept for its repeats. made: all that it depends on, besides shape and channels."""
    target: Tensor = source.dataset.load(item, shape, channels=channels)
    return target


@contextmanager
def repeatable(threads: int, device: torch.device = CPU) -> Iterator[None]:
    """The same numbers for the same input: threads as asked for, operations without a deterministic form refused.

    On a GPU single precision is meant as such, too: its convolutions would round to ten bits (TF32).
    """
    if device.type == "cuda":
        os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")  # read at the first product of matrices
        torch.backends.cudnn.allow_tf32 = torch.backends.cuda.matmul.allow_tf32 = False
    keep_freed_memory()
    before = torch.get_num_threads(), torch.get_deterministic_debug_mode()
    torch.set_default_dtype(torch.float32)  # a method's file may have changed these two for everybody
    torch.set_grad_enabled(True)
    _seed_globally(seed("global random numbers"), device)
    torch.set_num_threads(threads)
    torch.set_deterministic_debug_mode("error")  # use_deterministic_algorithms also imports torch's compiler, 1.5 s
    # Filling fresh memory guards against reading it too early; it would be timed with the methods.
    torch.utils.deterministic.fill_uninitialized_memory = False  # type: ignore[attr-defined]
    try:
        yield
    finally:
        torch.set_num_threads(before[0])
        torch.set_deterministic_debug_mode(before[1])


def _seed_globally(value: int, device: torch.device) -> None:
    """torch's own random numbers. ``torch.manual_seed`` would also note the whole stack for a GPU that is not in use,
    each time, which takes 2 ms."""
    torch.default_generator.manual_seed(value)
    if device.type == "cuda":
        torch.cuda.manual_seed_all(value)
