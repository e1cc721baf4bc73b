"""The predicted capture of another method's hologram, scored against the real capture (paper 6.1)."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Collection
from dataclasses import asdict, replace

import torch
from torch import Tensor

from ...core.device import moved
from ...core.errors import CellError, Pending
from ...core.hashing import digest
from ...display import RectifiedCapture
from ...display.phases import from_numpy, is_plain
from ...metrics import control, match
from .. import cost, isolation, opening
from ..artifacts import Artifact
from ..displays import Condition
from ..isolation import Reads
from ..phases import Solution
from ..plan import Cell
from ..store import Record
from ..versions import gate
from .changed import changed_target, moved_phase
from .job import Job, Measured
from .picture import account, keep_pictures, references, refuse_saturated
from .scores import keep_capture, scores_of
from .solution import solved_by, wrong_output

PHOTOGRAPHS_KEPT = 64  # in a process: all methods predict the same ones
More = Callable[[Tensor, Tensor, Tensor, Tensor], dict[str, float]]
"""Scores of a hologram, its target ``(C, h, w)``, its capture, and the prediction of that, in the same unit."""
AGAIN = "again"  # beside the changes of ``metrics.control``, another capture of the unchanged hologram


def prediction(job: Job, more: More = lambda *_: {}) -> Measured:
    """Predict the captures of the hologram that the study shows for the task's target, and of its changes where the
    study asks for control.

    Capture and prediction get the factors that match the capture to the target, so that the capture is a picture in
    [0, 1]; the protocol's own match of the prediction follows.

    more: gives further scores.
    """
    own, shown_on = job.task.cells[0], job.task.conditions[0]
    target = job.target(own, shown_on)
    ask(job, own, shown_on, ("", *further(job)))
    hologram, capture = shown(job, own, shown_on)
    others = {variant: shown(job, own, shown_on, variant) for variant in further(job)}
    learned = job.learned(job.task.preparation)
    predict = _predictor(job, own, shown_on, target, learned)
    for photograph in (capture, *(other for _, other in others.values())):
        refuse_saturated(photograph)
    predicted, taken, reads = predict(hologram.phase)
    answers: dict[str, float] = {}
    if others:
        again = others.pop(AGAIN)[1].image
        changed = {change: (other.image, predict(solved.phase)[0]) for change, (solved, other) in others.items()}
        answers = control.control(capture.image, again, predicted, changed)
    cost.keep(job.timing, taken.seconds)
    wanted, factors = match(capture.image, target)
    image, figures = factors.view(-1, 1, 1) * predicted, more(hologram.phase, target, capture.image, predicted)

    def compare(cell: Cell, _: Condition) -> Record:
        keep_pictures(job, cell, image, wanted, hologram.phase)
        keep_capture(job, cell, image, wanted)
        return job.record(
            cell,
            scores=scores_of(job, cell, image, wanted, job.setting.metrics, answers),
            figures=figures,
            alone=job.alone,
            registration_residual_px=capture.residual,
            saturated=capture.saturated,
            learned=account(learned),
            reads={**hologram.covered, **reads.covered},
            uncovered=tuple({*hologram.uncovered, *reads.uncovered}),
            **asdict(taken),
        )

    return compare


def _predictor(
    job: Job, cell: Cell, display: Condition, target: Tensor, learned: Artifact | None
) -> Callable[[Tensor], tuple[Tensor, cost.Cost, Reads]]:
    """What predicts the capture ``(C, h, w)`` of a hologram, and tells what that took and what was read."""
    method, label = job.method(cell.method, cell.params), job.task.label
    gate(method, cell.method, cell.code, isolation.digests(method, cell.target), cell.files)
    handle = opening.open_display(display, cell.seed, job.device).for_method(
        method,
        label,
        target.to(job.device),
        item=cell.target,
        repeat=cell.repeat,
        budget=0,  # the capture is what is to be predicted
        learned=moved(learned.state, job.device) if learned else None,
    )

    def predict(phase: Tensor) -> tuple[Tensor, cost.Cost, Reads]:
        own = phase[None].to(job.device, copy=True)
        with isolation.opened(method, job.device) as ready:
            watch = cost.Stopwatch(job.device, ready.pid, ready.late)
            predicted = method.predict(own, handle)
            taken = watch.stop()
        predicted = from_numpy(predicted)
        if not is_plain(predicted) or tuple(predicted.shape) != (1, *target.shape):
            raise wrong_output(label, "predict", predicted, f"an image {(1, *target.shape)}")
        return predicted.detach().cpu()[0], taken, ready.reads

    return predict


def floor(job: Job) -> Measured:
    """The scores of floor images on the capture that methods predict."""

    def wanted(cell: Cell, display: Condition) -> Tensor:
        return match(shown(job, cell, display)[1].image, job.target(cell, display))[0]

    measured = references(job, wanted)

    def reference(cell: Cell, display: Condition) -> Record:
        hologram, record = shown(job, cell, display)[0], measured(cell, display)
        return replace(record, reads={**record.reads, **hologram.covered}, uncovered=hologram.uncovered)

    return reference


def further(job: Job) -> tuple[str, ...]:
    """The captures that control needs beside that of the hologram, see ``shown``; none where it is not asked for."""
    return (AGAIN, *control.CHANGES) if control.NAME in job.setting.metrics else ()


def ask(job: Job, cell: Cell, display: Condition, variants: Collection[str]) -> None:
    """Have all photographs of a bench that other software drives asked for in one round, before any training."""
    waiting: Pending | None = None
    for variant in variants if display.real else ():
        try:
            shown(job, cell, display, variant)
        except Pending as error:
            waiting = error
    if waiting is not None:
        raise waiting


def shown(job: Job, cell: Cell, display: Condition, variant: str = "") -> tuple[Solution, RectifiedCapture]:
    """The hologram that a study shows for a target, and its capture. variant: a change of the hologram, whose capture
    is exposed as that of the unchanged one, or ``AGAIN``; each has noise of its own."""
    photograph = (digest(cell.holograms["phase"]), display, cell.seed, cell.repeat, cell.exposure, variant)
    known = _photographs.get(photograph)
    if known is None or isolation.changed(known[0].covered, job.setting.study.folder):
        hologram = _changed(job, cell, display, variant) if variant in control.CHANGES else _solved(job, cell, display)
        bench, target = opening.open_display(display, cell.seed, job.device), job.target(cell, display)
        item = f"{cell.target}, {variant}" if variant else cell.target  # it names the noise
        capture = bench.photograph(hologram.phase, target, item=item, repeat=cell.repeat, exposure=cell.exposure)
        _photographs[photograph] = hologram, capture
        while len(_photographs) > PHOTOGRAPHS_KEPT:
            _photographs.popitem(last=False)
    return _photographs[photograph]


_photographs: OrderedDict[object, tuple[Solution, RectifiedCapture]] = OrderedDict()


def _changed(job: Job, cell: Cell, display: Condition, change: str) -> Solution:
    """A hologram with a change. CellError where the method's hologram does not follow its target."""
    hologram = _solved(job, cell, display)
    if change == control.PHASE:
        return replace(hologram, phase=moved_phase(hologram.phase, cell.seed, cell.target))
    changed = _solved(job, cell, display, change)
    if torch.equal(changed.phase, hologram.phase):
        raise CellError(f"{cell.holograms['name']} has the same hologram for another target, so none has control")
    return changed


def _solved(job: Job, cell: Cell, display: Condition, change: str = "") -> Solution:
    """A hologram, of the changed target if there is a change: kept from before, or solved."""
    changed = {"changed": [change, control.VERSION]} if change else {}
    name, phase_id = cell.holograms["name"], digest({**cell.holograms["phase"], **changed})
    if (known := job.phases.read(phase_id)) is not None:
        return known
    bench, target = opening.open_display(display, cell.seed, job.device), job.target(cell, display)
    method = job.method(name, cell.holograms["params"])
    gate(method, name, cell.holograms["code"], isolation.digests(method, cell.target), cell.holograms["files"])
    handle = bench.for_method(method, name, target.to(job.device), item=cell.target, repeat=cell.repeat)
    wanted = changed_target(target, change, cell.seed, cell.target) if change else target
    own = wanted[None].to(job.device, copy=True)
    solved = solved_by(job, method, name, handle, lambda method, handle: method.solve(own, handle))
    if solved.phase.ndim == 4:
        raise CellError(f"holograms: {name} gives {len(solved.phase)} frames; models predict one")
    job.phases.keep(phase_id, solved)
    return solved
