"""Let a method solve a target, unless its phase is known."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from typing import Any

from torch import Tensor

from ...core.device import moved
from ...core.errors import BudgetError, CellError
from ...display import MeteredDisplay
from ...display.phases import from_numpy, is_plain, single, type_name
from .. import cost, identity, isolation
from ..displays import Condition
from ..phases import Solution, Starts
from ..versions import gate
from . import starts
from .job import Job

Solve = Callable[[Any, MeteredDisplay], Any]  # calls a method with its handle of the display


def solution(job: Job, display: Condition, target: Tensor, solve: Solve) -> Solution:
    """The solution of a task: kept from before, or what its method finds by ``solve`` on a display.

    target: ``(C, h, w)``, which the display is exposed for. The method works on a copy, so its changes cannot reach
    the score. Its inputs are on the job's device; its phase returns to the CPU.
    """
    first = job.task.cells[0]
    takes_captures = isolation.traits(first.method, job.setting.study.folder).camera
    with job.phases.locked(first.phase_id) if takes_captures else nullcontext():
        return _solution(job, display, target, solve)


def _solution(job: Job, display: Condition, target: Tensor, solve: Solve) -> Solution:
    task, first = job.task, job.task.cells[0]
    learned = job.learned(task.preparation)
    others = starts.of(job, first)
    # A start has the same name after another training, so what it is counts too.
    state = str(learned.provenance["sha256"]) if learned else starts.content(others)
    known = job.phases.read(first.phase_id, state)
    if known is not None and (known.alone or not job.timed):
        return known
    basis = {name: first.phase[name] for name in identity.BASIS}
    shared = Starts(job.phases, basis, job.device, job.given_reads())
    method = job.method(first.method, first.params)
    gate(method, first.method, first.code, isolation.digests(method, first.target), first.files)
    journal = job.phases.journal(first.phase_id)
    if display.in_session:  # its photographs are found again by each import, and so are no new captures
        journal.close()
    handle = job.display(first, display).for_method(
        method,
        task.label,
        target.to(job.device),
        item=first.target,
        repeat=first.repeat,
        budget=first.captures,
        learned=moved(learned.state, job.device) if learned else None,
        starts=[phase for phase in others if phase.ndim == 3],  # of one frame
        sha256=first.target_sha256,
        known=None if job.timed else shared,
        journal=journal,
    )
    solved = solved_by(job, method, task.label, handle, solve)
    taken = solved.cost.after(known.cost for known in shared.before)
    alone = job.alone and all(known.alone for known in shared.before)
    cost.keep(job.timing, taken.seconds)
    solved = replace(solved, captures=journal.captures, cost=taken, learned=state, alone=alone)
    if len(others) == len(first.phase.get("starts", ())):  # of those that name it, one that has failed may yet be there
        job.phases.keep(first.phase_id, solved)
    return solved


def solved_by(job: Job, method: Any, label: str, handle: MeteredDisplay, solve: Solve) -> Solution:
    """What a method finds by ``solve``. CellError for what is no phase; label: how the error calls the method."""
    with isolation.opened(method, job.device) as ready:
        watch = cost.Stopwatch(job.device, ready.pid, ready.late)
        output, stopped = _within_budget(method, solve, handle)
        taken = watch.stop()
    output, channels = from_numpy(output), len(handle.spec.wavelengths)
    phase = single(output, channels) if is_plain(output) else None
    if phase is None:
        frames = "" if handle.spec.frames == 1 else f", or frames (1, F, {channels}, H, W)"
        raise wrong_output(label, "solve", output, f"a phase (1, {channels}, H, W){frames}")
    return Solution(
        phase.detach().cpu(),
        handle.captures,
        taken,
        stopped,
        alone=job.alone,
        shown=handle.shown,
        **vars(job.given_reads() | ready.reads),
    )


def wrong_output(label: str, function: str, output: Any, wanted: str) -> CellError:
    """The error for an ``output`` that is not what was wanted."""
    actual = tuple(output.shape) if is_plain(output) else type_name(output)
    return CellError(f"{label}: {function} returned {actual}, not {wanted}")


def _within_budget(method: Any, solve: Solve, handle: MeteredDisplay) -> tuple[Any, str]:
    """The output of ``solve`` and an empty reason. If the display ended the captures: the best hologram so far and the
    reason, however the method handled the end."""
    phase = None
    try:
        phase = solve(method, handle)
    except BudgetError:
        if not handle.over:
            raise
    if handle.over and handle.kept is not None:
        phase = handle.kept[None]
    if handle.over and phase is None:
        raise BudgetError(f"{handle.over} and kept no phase; bench.keep(phase) keeps the best so far")
    return phase, handle.over
