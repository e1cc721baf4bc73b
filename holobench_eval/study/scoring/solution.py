"""Let a method solve a target; solutions of a session are kept, since their photographs come later."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import torch
from torch import Tensor

from ...core.device import moved
from ...core.errors import BudgetError, CellError
from ...core.hashing import digest
from ...core.io import write_atomically
from ...display import MeteredDisplay
from ...display.api import from_numpy, is_plain, type_name
from .. import cost, isolation
from ..artifacts import Artifact, read_tensors
from ..cost import Cost
from ..displays import Condition
from ..isolation.read_files import digests
from ..plan import Cell
from . import starts
from .job import Job

FOLDER = "solutions"
PATHS = ("path", "manifest")  # parameters of data sets that say where images lie; a cell has the digest of its image

Solve = Callable[[Any, MeteredDisplay], Any]  # calls a method with its handle of the display


@dataclass(frozen=True)
class Solution:
    """A method's phase ``(C, H, W)`` [rad], its captures and cost, why the display ended the solution (empty: it did
    not), and the learned state."""

    phase: Tensor
    captures: int
    cost: Cost
    stopped: str
    learned: Artifact | None


def solution(job: Job, display: Condition, target: Tensor, solve: Solve) -> Solution:
    """Let the task's method ``solve`` on a display, in the name of the task's first cell.

    target: ``(C, h, w)``, which the display is exposed for. The method works on a copy, so its changes cannot reach
    the score. Its inputs are on the job's device; its phase returns to the CPU.
    """
    task, first = job.task, job.task.cells[0]
    learned = job.learned(task.preparation)
    method = job.method(first.method, first.params)
    if isinstance(method, isolation.Apart) and method.code_version != first.method_sha256:
        raise CellError(f"the code of {first.method} has changed since the study was planned; start the run again")
    if digests(method, first.target) != first.files:
        raise CellError(f"a file that {task.label} reads has changed since the study was planned; start the run again")
    handle = job.display(first, display).for_method(
        method,
        task.label,
        target.to(job.device),
        item=first.target,
        repeat=first.repeat,
        budget=first.captures,
        learned=moved(learned.state, job.device) if learned else None,
        starts=starts.of(job.store, first),
        sha256=first.target_sha256,
    )
    with isolation.opened(method, job.device) as process:
        watch = cost.start(job.device, process)
        phase, stopped = _within_budget(method, solve, handle)
        taken = watch.stop()
    phase = from_numpy(phase)
    if not is_plain(phase) or tuple(phase.shape[:2]) != (1, len(target)):
        raise wrong_output(task.label, "solve", phase, f"a phase (1, {len(target)}, H, W)")
    cost.keep(job.timing, taken)
    return Solution(phase.detach().cpu()[0], handle.captures, taken, stopped, learned)


def wrong_output(label: str, function: str, output: Any, wanted: str) -> CellError:
    """The error for an ``output`` that is not what was wanted."""
    named = output.type_name if isinstance(output, isolation.Unsendable) else type_name(output)
    actual = tuple(output.shape) if is_plain(output) else named
    return CellError(f"{label}: {function} returned {actual}, not {wanted}")


def _within_budget(method: Any, solve: Solve, handle: MeteredDisplay) -> tuple[Any, str]:
    """The output of ``solve`` and an empty reason. If the display ended the captures: the best hologram so far and the
    reason, however the method handled the end."""
    phase = None
    try:
        phase = solve(method, handle)
    except BudgetError:
        if not handle.over or handle.kept is None:
            raise
    if handle.over and handle.kept is not None:
        phase = handle.kept[None]
    return phase, handle.over


def kept(job: Job, make: Callable[[], Solution]) -> Solution:
    """The solution of a task, computed once and kept in the output folder under what it depends on."""
    path = job.setting.output / FOLDER / f"{_identity(job.task.cells[0])}.pt"
    if path.is_file():
        content = read_tensors(path)
        learned = job.learned(job.task.preparation)
        return Solution(content["phase"], content["captures"], Cost(**content["taken"]), content["stopped"], learned)
    fresh, buffer = make(), io.BytesIO()
    account = {"captures": fresh.captures, "taken": asdict(fresh.cost), "stopped": fresh.stopped}
    torch.save({"phase": fresh.phase, **account}, buffer)
    write_atomically(path, buffer.getvalue())
    return fresh


def _identity(cell: Cell) -> str:
    """The name of a cell's solution: the same wherever its images lie, and whatever can be measured there and how.

    A session is imported where another version of the harness, other metrics or other folders may be.
    """
    description = cell.description()
    for measured in ("harness_sha256", "metrics", "protocol"):
        del description[measured]
    params = description["dataset_params"]
    return digest({**description, "dataset_params": {name: params[name] for name in params if name not in PATHS}})
