"""How a cell becomes scores: a picture against its target, a prediction against a capture, a reference image.

Focal stacks are in ``focus``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor

from ..core import plugins
from ..core.device import moved
from ..core.errors import BudgetError, CellError
from ..core.io import file_name
from ..lab.photograph import MOST_SATURATED
from ..lab.real import RealBench
from ..metrics import floor_captures, match, score
from . import cost, solutions, timings
from .artifacts import Artifact
from .displays import Condition, workbench
from .job import Job, target_of
from .pictures import write_capture, write_phase, write_thumbnail
from .plan import Cell
from .solutions import Solution
from .store import Record, Store

if TYPE_CHECKING:
    from ..display import CalibratedBench
    from ..display.api import RectifiedCapture
    from ..display.learned import LearnedBench
    from ..display.metered import MeteredDisplay

Measure = Callable[[Cell, Condition], Record]
Scored = Callable[[Job, Cell, Tensor, Tensor], dict[str, float]]
"""The scores of an image ``(C, h, w)`` against the wanted one."""


def plain(job: Job, _: Cell, image: Tensor, wanted: Tensor) -> dict[str, float]:
    """The scores of the metric protocol."""
    return score(image, wanted, metrics=job.setting.metrics, lpips_weights=job.setting.lpips_weights)


def picture(job: Job) -> Measure:
    """Solve the task's target on its first display; the result shows the phase on any of its displays."""
    place = job.task.conditions[0]
    target = target_of(job.task.cells[0], place, job.setting.folder)

    def make() -> Solution:
        shown = target[None].to(job.device, copy=True)
        return solution(job, place, target, lambda method, handle: method.solve(shown, handle))

    in_session = place.real is not None and place.real.folder is not None
    made = solutions.kept(job, make) if in_session else make()
    return lambda cell, place: captured(job, made, cell, place, target)


def solution(job: Job, place: Condition, target: Tensor, solve: Callable[[Any, MeteredDisplay], Any]) -> Solution:
    """Let the task's method ``solve`` on a display, in the name of the task's first cell.

    target: ``(C, h, w)``, which the display is exposed for. What a method does to its own must not reach the score.
    What the method is given is on the job's device, and what it made comes back to the CPU.
    """
    task, setting = job.task, job.setting
    first, learned = task.cells[0], job.learned(task.preparation)
    method = plugins.build("methods", first.method, dict(first.params), setting.folder)
    handle = job.bench(first, place).for_method(
        method,
        task.label,
        target.to(job.device),
        item=first.target,
        repeat=first.repeat,
        budget=first.captures,
        learned=moved(learned.state, job.device) if learned else None,
    )
    watch = cost.start(job.device)
    solved, stopped = _within_budget(method, solve, handle)
    taken = watch.stop()
    if not isinstance(solved, Tensor) or tuple(solved.shape[:2]) != (1, len(target)):
        found = tuple(solved.shape) if isinstance(solved, Tensor) else type(solved).__name__
        raise CellError(f"{task.label}: solve returned {found}, not a phase (1, {len(target)}, H, W)")
    taken = timings.keep(job.timing, taken, setting.retime)
    return Solution(solved.detach().cpu()[0], handle.captures, taken, stopped, learned)


def captured(job: Job, made: Solution, cell: Cell, place: Condition, target: Tensor, scored: Scored = plain) -> Record:
    """Show a solution on a display, photograph it and score it against ``target`` ``(C, h, w)``."""
    label = job.task.label
    shot = job.bench(cell, place).photograph(
        made.phase, target, item=cell.target, repeat=cell.repeat, exposure=cell.exposure, label=label
    )
    _refuse_saturated(shot)
    _save(job, cell, shot.image, made.phase)
    scores = scored(job, cell, shot.image, target) | _second_scores(job.bench(cell, place), shot, target)
    write_thumbnail(Store(job.setting.output).thumbnail(cell.id), match(shot.image, target)[0])
    return Record(
        cell=cell.description(),
        state="done",
        label=label,
        scores=scores | {"efficiency": shot.efficiency},
        captures=made.captures,
        seconds=made.taken.seconds,
        alone=job.alone,
        memory_mib=made.taken.memory_mib,
        registration_residual_px=shot.residual,
        saturated=shot.saturated,
        learned=_account(made.learned),
        stopped=made.stopped,
    )


def _second_scores(
    bench: CalibratedBench | RealBench | LearnedBench, shot: RectifiedCapture, target: Tensor
) -> dict[str, float]:
    """PSNR and SSIM of a real photograph by the geometry that another algorithm found."""
    image = bench.second_image(shot, target) if isinstance(bench, RealBench) else None
    if image is None:
        return {}
    again = score(image, target, refine=False, blur=(), metrics=("psnr", "ssim"))
    return {f"{name}_linear_second": again[f"{name}_linear"] for name in ("psnr", "ssim")}


def _within_budget(method: Any, solve: Callable[[Any, MeteredDisplay], Any], handle: MeteredDisplay) -> tuple[Any, str]:
    """What ``solve`` returns and an empty line; the best hologram so far and why, if the display ended its captures,
    whatever the method made of that."""
    solved = None
    try:
        solved = solve(method, handle)
    except BudgetError:
        if not handle.over or handle.kept is None:
            raise
    if handle.over and handle.kept is not None:
        solved = handle.kept[None]
    return solved, handle.over


def prediction(job: Job) -> Measure:
    """What a method predicts of the capture of another method's hologram, scored against that capture (paper 6.1).

    Capture and prediction get the factors that match the capture to the target, so that the capture is a picture in
    [0, 1]; the protocol's own match of the prediction follows.
    """
    task, setting = job.task, job.setting
    cell, place = task.cells[0], task.conditions[0]
    method = plugins.build("methods", cell.method, dict(cell.params), setting.folder)
    learned, target = job.learned(task.preparation), target_of(cell, place, setting.folder)
    phase, shot = _shown(_Shown(cell), place, setting.folder, job.device)
    _refuse_saturated(shot)
    wanted, factors = match(shot.image, target)
    handle = workbench(place, cell.seed, job.device).for_method(
        method,
        task.label,
        target.to(job.device),
        item=cell.target,
        repeat=cell.repeat,
        budget=0,  # the capture is what is to be predicted
        learned=moved(learned.state, job.device) if learned else None,
    )
    given = phase[None].to(job.device, copy=True)
    watch = cost.start(job.device)
    predicted = method.predict(given, handle)
    taken = watch.stop()
    if not isinstance(predicted, Tensor) or tuple(predicted.shape) != (1, *wanted.shape):
        found = tuple(predicted.shape) if isinstance(predicted, Tensor) else type(predicted).__name__
        raise CellError(f"{task.label}: predict returned {found}, not an image {(1, *wanted.shape)}")
    image = factors.view(-1, 1, 1) * predicted.detach().cpu()[0]
    taken = timings.keep(job.timing, taken, setting.retime)

    def compare(cell: Cell, _: Condition) -> Record:
        _save(job, cell, image, phase)
        write_thumbnail(Store(setting.output).thumbnail(cell.id), match(image, wanted)[0])
        return Record(
            cell=cell.description(),
            state="done",
            label=task.label,
            scores=plain(job, cell, image, wanted),
            seconds=taken.seconds,
            alone=job.alone,
            memory_mib=taken.memory_mib,
            registration_residual_px=shot.residual,
            saturated=shot.saturated,
            learned=_account(learned),
        )

    return compare


def floor(job: Job, scored: Scored = plain) -> Measure:
    """What images that no display made score on the task's target, or on the capture that is to be predicted."""
    setting, cells, place = job.setting, job.task.cells, job.task.conditions[0]
    shown = [cells[0], *(replace(cell, **cell.params) for cell in cells if cell.params)]
    images = [_wanted(cell, place, setting.folder, job.device) for cell in shown]
    captures = floor_captures(images[0], images[1:], cells[0].seed, cells[0].target)
    write_thumbnail(Store(setting.output).target_thumbnail(cells[0].target), images[0])

    def reference(cell: Cell, _: Condition) -> Record:
        scores = scored(job, cell, captures[cell.method], images[0])
        return Record(cell.description(), "done", cell.method, scores=scores)

    return reference


def _wanted(cell: Cell, place: Condition, folder: Path, device: torch.device) -> Tensor:
    """What a cell's image is compared with, ``(C, h, w)`` linear light in [0, 1]: its target, or a capture."""
    target = target_of(cell, place, folder)
    if cell.measure != "prediction":
        return target
    return match(_shown(_Shown(cell), place, folder, device)[1].image, target)[0]


class _Shown:
    """A cell as far as the hologram goes whose capture is predicted; equal for all methods that predict it."""

    def __init__(self, cell: Cell) -> None:
        self.cell = cell
        self.key = (repr(cell.holograms), cell.target, cell.target_sha256, cell.profile_sha256, cell.repeat, cell.seed)

    def __hash__(self) -> int:
        return hash(self.key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Shown) and self.key == other.key


@lru_cache(maxsize=64)
def _shown(shown: _Shown, place: Condition, folder: Path, device: torch.device) -> tuple[Tensor, RectifiedCapture]:
    """The phase ``(C, H, W)`` of the hologram that a study shows for a target, and its capture; once in a process."""
    cell = shown.cell
    bench, target = workbench(place, cell.seed, device), target_of(cell, place, folder)
    given = target.to(device, copy=True)
    method = plugins.build("methods", cell.holograms["name"], dict(cell.holograms["params"]), folder)
    handle = bench.for_method(method, cell.holograms["name"], given, item=cell.target, repeat=cell.repeat)
    phase = method.solve(given[None], handle).detach().cpu()[0]
    return phase, bench.photograph(phase, target, item=cell.target, repeat=cell.repeat, exposure=cell.exposure)


def _refuse_saturated(shot: RectifiedCapture) -> None:
    if shot.saturated > MOST_SATURATED:
        raise CellError(f"{shot.saturated:.2%} of the capture is saturated, more than {MOST_SATURATED:.1%}")


def _account(learned: Artifact | None) -> dict[str, Any] | None:
    """What a record says of the training behind it."""
    if learned is None:
        return None
    known = learned.provenance
    return {"sha256": known["sha256"], "captures": known["captures"], "seconds": known["seconds"]}


def _save(job: Job, cell: Cell, image: Tensor, phase: Tensor) -> None:
    setting = job.setting
    name = file_name(cell.target) + (f"-{cell.repeat}" if cell.repeat else "") + ".png"
    place = Path(file_name(job.task.label), file_name(cell.condition), name)
    if setting.save.captures:
        write_capture(setting.output / "captures" / place, image)
    if setting.save.phases:
        write_phase(setting.output / "phases" / place, phase)
