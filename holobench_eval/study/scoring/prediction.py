"""The predicted capture of another method's hologram, scored against the real capture (paper 6.1)."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Collection
from dataclasses import asdict, dataclass, replace

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
from ..isolation.read_files import digests
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
AGAIN = "again"  # beside the changes of ``metrics.control``, another capture of the unchanged hologram


def prediction(job: Job) -> Measured:
    """Predict the capture of the hologram that the study shows for the task's target.

    Capture and prediction get the factors that match the capture to the target, so that the capture is a picture in
    [0, 1]; the protocol's own match of the prediction follows.
    """
    return compared(job, lambda seen: {})


@dataclass(frozen=True)
class Foreseen:
    """A hologram of a target ``(C, h, w)``, its capture, and the prediction of that ``(C, h, w)``, in the same unit;
    the columns of control, where the study asks for it; what the prediction took, what was learned before, and what was
    read."""

    hologram: Solution
    target: Tensor
    capture: RectifiedCapture
    prediction: Tensor
    answers: dict[str, float]
    taken: cost.Cost
    learned: Artifact | None
    reads: Reads


def _foresee(job: Job) -> Foreseen:
    """Predict the captures of the hologram of the task's target, and of its changes."""
    task, cell, display = job.task, job.task.cells[0], job.task.conditions[0]
    target = job.target(cell, display)
    ask(job, cell, display, ("", *further(job)))
    hologram, capture = shown(job, cell, display)
    others = {variant: shown(job, cell, display, variant) for variant in further(job)}
    method, learned = job.method(cell.method, cell.params), job.learned(task.preparation)
    gate(method, cell.method, cell.code, digests(method, cell.target), cell.files)
    for photograph in (capture, *(other for _, other in others.values())):
        refuse_saturated(photograph)
    handle = opening.open_display(display, cell.seed, job.device).for_method(
        method,
        task.label,
        target.to(job.device),
        item=cell.target,
        repeat=cell.repeat,
        budget=0,  # the capture is what is to be predicted
        learned=moved(learned.state, job.device) if learned else None,
    )

    def predict(phase: Tensor) -> tuple[Tensor, cost.Cost, Reads]:
        own = phase[None].to(job.device, copy=True)
        with isolation.opened(method, job.device) as ready:
            watch = cost.start(job.device, ready.pid)
            predicted = method.predict(own, handle)
            taken = watch.stop()
        predicted = from_numpy(predicted)
        if not is_plain(predicted) or tuple(predicted.shape) != (1, *target.shape):
            raise wrong_output(task.label, "predict", predicted, f"an image {(1, *target.shape)}")
        return predicted.detach().cpu()[0], taken, ready.reads

    predicted, taken, reads = predict(hologram.phase)
    answers: dict[str, float] = {}
    if others:
        again = others.pop(AGAIN)[1].image
        changed = {change: (other.image, predict(own.phase)[0]) for change, (own, other) in others.items()}
        answers = control.control(capture.image, again, predicted, changed)
    return Foreseen(hologram, target, capture, predicted, answers, taken, learned, reads)


def compared(job: Job, more: Callable[[Foreseen], dict[str, float]]) -> Measured:
    """Predict the capture, and score the prediction by the protocol; ``more`` gives further scores."""
    seen = _foresee(job)
    cost.keep(job.timing, seen.taken.seconds)
    wanted, factors = match(seen.capture.image, seen.target)
    image, figures = factors.view(-1, 1, 1) * seen.prediction, more(seen)

    def compare(cell: Cell, _: Condition) -> Record:
        keep_pictures(job, cell, image, wanted, seen.hologram.phase)
        keep_capture(job, cell, image, wanted)
        return job.record(
            cell,
            scores=scores_of(job, cell, image, wanted, job.setting.metrics, seen.answers),
            figures=figures,
            alone=job.alone,
            registration_residual_px=seen.capture.residual,
            saturated=seen.capture.saturated,
            learned=account(seen.learned),
            reads={**seen.hologram.covered, **seen.reads.covered},
            uncovered=tuple({*seen.hologram.uncovered, *seen.reads.uncovered}),
            **asdict(seen.taken),
        )

    return compare


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
    if known is None or isolation.changed(known[0].covered, job.setting.folder):
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
    gate(method, name, cell.holograms["code"], digests(method, cell.target), cell.holograms["files"])
    handle = bench.for_method(method, name, target.to(job.device), item=cell.target, repeat=cell.repeat)
    wanted = changed_target(target, change, cell.seed, cell.target) if change else target
    own = wanted[None].to(job.device, copy=True)
    solved = solved_by(job, method, name, handle, lambda method, handle: method.solve(own, handle))
    if solved.phase.ndim == 4:
        raise CellError(f"holograms: {name} gives {len(solved.phase)} frames; models predict one")
    job.phases.keep(phase_id, solved)
    return solved
