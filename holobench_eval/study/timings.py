"""The time and the memory a solution takes are measured once on a machine and then kept.

They are the only numbers of a table that differ from run to run. So that the same command on the same
machine gives the same table, and a run that was killed and resumed gives the table of one that was not, the
first measurement of every solution is kept in ``$XDG_CACHE_HOME`` (or ``~/.cache``)
``/holobench_eval/timings/`` and later runs report it. ``holoeval run --retime`` measures again. Where the
folder cannot be written, every run reports what it measures itself.
"""

from __future__ import annotations

import json
import math
import os
import platform
from dataclasses import asdict
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import __version__
from ..core.hashing import digest
from ..core.io import write_atomically
from .cost import Cost
from .plan import Plan, Task

if TYPE_CHECKING:
    from .config import Study


def folder() -> Path:
    """Where timings are kept."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "holobench_eval/timings")


@cache
def cpu_model() -> str:
    """The processor's name, as far as the system tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else platform.processor() or platform.machine()


@cache
def _torch() -> str:
    """Its version, read from its metadata once: that takes longer than all the rest of a name."""
    return version("torch")


def timed(study: Study, plan: Plan) -> frozenset[str]:
    """Cells of the solutions that a study with ``timing: alone`` measures with nothing beside them; none for another.

    Of every row of the tables it is the last of the first repeat: a method's first solution also loads libraries.
    """
    if study.timing == "shared":
        return frozenset()
    last = {
        (task.label, cell.condition): task
        for task in plan.tasks
        if not task.is_floor
        for cell in task.cells
        if cell.repeat == 0
    }
    return frozenset(cell.id for task in last.values() for cell in task.cells)


def key(task: Task, threads: int, workers: int, gpu: str = "") -> str:
    """Name of a task's timing: the hash of everything its wall time should depend on. gpu: its name, empty for none."""
    cell, place = task.cells[0], task.conditions[0]
    return digest(
        {
            "method": [cell.method, cell.method_sha256, dict(cell.params), *([cell.captures] if cell.captures else [])],
            "target": [cell.target_sha256, dict(cell.dataset_params)],
            "display": [repr(place.spec), place.digest, cell.exposure, *([dict(cell.change)] if cell.change else [])],
            "noise": [cell.seed, cell.repeat],
            "learned": [cell.measure, *cell.prepared],
            "measure": cell.measure,
            "machine": [cpu_model(), platform.machine(), threads, workers, *([gpu] if gpu else [])],
            "versions": [_torch(), __version__],
        }
    )


def names() -> frozenset[str]:
    """Those of all timings that are kept."""
    return frozenset(path.stem for path in folder().glob("*.json"))


def known(name: str) -> Cost | None:
    """The first measurement under a name, None if there is none; of an earlier version, without memory."""
    try:
        content: Any = json.loads((folder() / f"{name}.json").read_text(encoding="utf-8"))
        seconds, memory = float(content["seconds"]), content.get("memory_mib")
        effort = Cost(seconds, None if memory is None else float(memory))
    except (OSError, ValueError, TypeError, KeyError):
        return None
    sizes = [effort.seconds, *([] if effort.memory_mib is None else [effort.memory_mib])]
    return effort if all(math.isfinite(size) and size >= 0 for size in sizes) else None


def keep(name: str, effort: Cost, again: bool = False) -> Cost:
    """Note a measurement and return the one to report: the first, or this one when it is measured again."""
    first = None if again else known(name)
    if first is not None and (first.memory_mib is not None or effort.memory_mib is None):
        return first
    kept = effort if first is None else Cost(first.seconds, effort.memory_mib)
    try:
        write_atomically(folder() / f"{name}.json", json.dumps(asdict(kept)).encode())
    except OSError:
        return kept
    return kept
