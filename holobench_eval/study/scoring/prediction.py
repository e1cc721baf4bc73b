"""The predicted capture of another method's hologram, scored against the real capture (paper 6.1)."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import torch
from torch import Tensor

from ...core.device import moved
from ...core.hashing import canonical
from ...display import RectifiedCapture
from ...display.api import Exposure, from_numpy, is_plain
from ...metrics import match
from .. import cost, isolation, opening
from ..artifacts import Artifact
from ..definition import Isolation, Limits
from ..displays import Condition
from ..plan import Cell
from ..store import Record
from .job import Job, Measured, TargetSource, load_target
from .picture import account, keep_pictures, protocol_scores, references, refuse_saturated
from .solution import wrong_output

Apart = tuple[Isolation, Limits]  # whose methods run in processes of their own, and within which limits


def prediction(job: Job) -> Measured:
    """Predict the capture of the hologram that the study shows for the task's target.

    Capture and prediction get the factors that match the capture to the target, so that the capture is a picture in
    [0, 1]; the protocol's own match of the prediction follows.
    """
    return compared(job, lambda seen: {})


@dataclass(frozen=True)
class Foreseen:
    """A hologram ``(C, H, W)`` [rad] of a target ``(C, h, w)``, its capture, and the prediction of that ``(C, h, w)``,
    in the same unit; what the prediction took, and what was learned before."""

    phase: Tensor
    target: Tensor
    capture: RectifiedCapture
    prediction: Tensor
    taken: cost.Cost
    learned: Artifact | None


def _foresee(job: Job) -> Foreseen:
    """Predict the capture of the hologram of the task's target."""
    task, cell, display = job.task, job.task.cells[0], job.task.conditions[0]
    target = job.target(cell, display)
    phase, capture = shown(job, cell, display)
    method, learned = job.method(cell.method, cell.params), job.learned(task.preparation)
    refuse_saturated(capture)
    handle = opening.open_display(display, cell.seed, job.device).for_method(
        method,
        task.label,
        target.to(job.device),
        item=cell.target,
        repeat=cell.repeat,
        budget=0,  # the capture is what is to be predicted
        learned=moved(learned.state, job.device) if learned else None,
    )
    own = phase[None].to(job.device, copy=True)
    with isolation.opened(method, job.device) as process:
        watch = cost.start(job.device, process)
        predicted = method.predict(own, handle)
        taken = watch.stop()
    predicted = from_numpy(predicted)
    if not is_plain(predicted) or tuple(predicted.shape) != (1, *target.shape):
        raise wrong_output(task.label, "predict", predicted, f"an image {(1, *target.shape)}")
    return Foreseen(phase, target, capture, predicted.detach().cpu()[0], taken, learned)


def compared(job: Job, more: Callable[[Foreseen], dict[str, float]]) -> Measured:
    """Predict the capture, and score the prediction by the protocol; ``more`` gives further scores."""
    seen = _foresee(job)
    wanted, factors = match(seen.capture.image, seen.target)
    image = factors.view(-1, 1, 1) * seen.prediction
    taken = seen.taken
    cost.keep(job.timing, taken)
    further = more(seen)

    def compare(cell: Cell, _: Condition) -> Record:
        keep_pictures(job, cell, image, wanted, seen.phase)
        return Record(
            cell=cell.description(),
            state="done",
            label=job.task.label,
            scores=protocol_scores(job, cell, image, wanted) | further,
            seconds=taken.seconds,
            alone=job.alone,
            memory_mib=taken.memory_mib,
            registration_residual_px=seen.capture.residual,
            saturated=seen.capture.saturated,
            learned=account(seen.learned),
        )

    return compare


def floor(job: Job) -> Measured:
    """The scores of floor images on the capture that methods predict."""

    def wanted(cell: Cell, display: Condition) -> Tensor:
        return match(shown(job, cell, display)[1].image, job.target(cell, display))[0]

    return references(job, wanted)


@dataclass(frozen=True)
class _Hologram:
    """The hologram whose capture is predicted; equal for all methods that predict it. params: as JSON."""

    method: str
    version: str
    params: str
    source: TargetSource
    repeat: int
    seed: int
    exposure: Exposure


def shown(job: Job, cell: Cell, display: Condition, again: bool = False) -> tuple[Tensor, RectifiedCapture]:
    """The phase ``(C, H, W)`` of the hologram that a study shows for a target, and its capture; or, ``again``, another
    capture of it, with noise of its own."""
    name, params = cell.holograms["name"], canonical(dict(cell.holograms["params"]))
    hologram = _Hologram(
        name, cell.holograms["sha256"], params, job.source(cell), cell.repeat, cell.seed, cell.exposure
    )
    setting = job.setting
    return _photographed(hologram, display, setting.folder, job.device, again, (setting.isolation, setting.limits))


@lru_cache(maxsize=64)
def _solved(hologram: _Hologram, display: Condition, folder: Path, device: torch.device, apart: Apart) -> Tensor:
    """The phase of a hologram, computed once in a process."""
    bench, target = opening.open_display(display, hologram.seed, device), load_target(hologram.source, display)
    item, own = hologram.source[3], target.to(device, copy=True)
    method = isolation.solver(hologram.method, json.loads(hologram.params), folder, *apart)
    handle = bench.for_method(method, hologram.method, own, item=item, repeat=hologram.repeat)
    phase = from_numpy(method.solve(own[None], handle))
    if not is_plain(phase) or tuple(phase.shape[:2]) != (1, len(target)):
        raise wrong_output(hologram.method, "solve", phase, f"a phase (1, {len(target)}, H, W)")
    solved: Tensor = phase.detach().cpu()[0]
    return solved


@lru_cache(maxsize=64)
def _photographed(
    hologram: _Hologram, display: Condition, folder: Path, device: torch.device, again: bool, apart: Apart
) -> tuple[Tensor, RectifiedCapture]:
    """The phase of a hologram and a capture of it, taken once in a process."""
    bench, target = opening.open_display(display, hologram.seed, device), load_target(hologram.source, display)
    item = f"{hologram.source[3]}, again" if again else hologram.source[3]  # it names the noise
    phase = _solved(hologram, display, folder, device, apart)
    return phase, bench.photograph(phase, target, item=item, repeat=hologram.repeat, exposure=hologram.exposure)
