"""A picture against its target: solve, show, photograph, score; and the scores of floor images."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from torch import Tensor

from ...core import plugins
from ...core.errors import CellError
from ...core.io import file_name
from ...display import CalibratedBench, RectifiedCapture
from ...display.learned import LearnedBench
from ...display.phases import phase_doubt
from ...lab.photograph import MOST_SATURATED
from ...lab.real import RealBench
from ...metrics import floor_captures, match, score
from .. import identity, isolation
from ..artifacts import Artifact
from ..displays import Condition
from ..phases import Solution
from ..plan import Cell
from ..stacks import INFOCUS
from ..store import Record
from .job import Job, Measured
from .pictures import write_capture, write_phase, write_thumbnail
from .scores import keep_capture, kept_capture, scores_of
from .solution import solution

VERIFIED = (identity.MATCH, "psnr", "ssim", INFOCUS)  # scores that take milliseconds


def picture(job: Job) -> Measured:
    """Solve the task's target on its first display; the result shows the phase on any of its displays."""
    display = job.task.conditions[0]
    target = job.target(job.task.cells[0], display)
    own = target[None].to(job.device, copy=True)
    solved = solution(job, display, target, lambda method, handle: method.solve(own, handle))
    return lambda cell, shown_on: captured(job, solved, cell, shown_on, target)


def floor(job: Job) -> Measured:
    """The scores of floor images on the task's target."""
    return references(job, job.target)


def captured(job: Job, solved: Solution, cell: Cell, display: Condition, target: Tensor) -> Record:
    """Show a solution on a display, photograph it and score it against ``target`` ``(C, h, w)``."""
    bench = job.display(cell, display)
    capture = bench.photograph(
        solved.phase, target, item=cell.target, repeat=cell.repeat, exposure=cell.exposure, label=job.task.label
    )
    refuse_saturated(capture)
    keep_pictures(job, cell, capture.image, target, solved.phase)
    keep_capture(job, cell, capture.image, lasting=display.real is not None)
    traits = isolation.traits(cell.method, job.setting.study.folder)
    is_own = traits.timed and plugins.is_shipped("methods", cell.method)  # none of those here has a doubtful phase
    looked_at = not is_own and cell.measure == "picture"  # else the phase is for other planes, too
    return job.record(
        cell,
        scores=scores_of(job, cell, capture.image, target, job.setting.metrics),
        figures=_second_scores(bench, capture, target) | {"efficiency": capture.efficiency},
        captures=solved.captures,
        reused=solved.reused,
        alone=solved.alone,
        frames=len(solved.phase) if solved.phase.ndim == 4 else 1,
        shown=solved.shown,
        registration_residual_px=capture.residual,
        saturated=capture.saturated,
        learned=account(job.learned(job.task.preparation)),
        stopped=solved.stopped,
        remark=phase_doubt(solved.phase, target, display.spec, traits.sees or traits.trains, traits.timed)
        if looked_at
        else "",
        reads=solved.covered,
        uncovered=solved.uncovered,
        **asdict(solved.cost) if traits.timed else {},
    )


def references(job: Job, wanted: Callable[[Cell, Condition], Tensor]) -> Measured:
    """The scores of the floor images. wanted: gives the picture that a cell's image is compared with."""
    cells, display = job.task.cells, job.task.conditions[0]
    others = [replace(cell, **cell.params, holograms=cell.holograms.get("wrong", {})) for cell in cells if cell.params]
    target, *wrong = (wanted(cell, display) for cell in (cells[0], *others))
    captures = floor_captures(target, wrong, cells[0].seed, cells[0].target)
    write_thumbnail(job.store.target_thumbnail(cells[0].target, target.shape), target)

    def reference(cell: Cell, _: Condition) -> Record:
        image = captures[cell.method]()
        if cell.shown_on is not None:  # else it is computed again from the target
            keep_capture(job, cell, image, target)
        return job.record(cell, scores=scores_of(job, cell, image, target, job.setting.metrics))

    return reference


def rescored(job: Job, cell: Cell, display: Condition) -> Record:
    """The record of a captured cell, with the scores that it lacked."""
    record = job.store.read(cell.id)
    assert record is not None
    scores = _of_kept(job, cell, display, identity.lacking(record.scores, job.setting.metrics))
    return replace(record, scores=record.scores | scores)


def verified(job: Job, cell: Cell, display: Condition, record: Record) -> dict[str, float]:
    """The headline, PSNR and SSIM of a kept capture, by column, of those that its record has by today's versions.
    CellError where nothing is kept that is whole."""
    if not kept_capture(job.store.capture(cell.id)):
        raise CellError("its kept capture is damaged, of another cell, or kept by an earlier state of the package")
    headline = job.setting.study.headline
    metrics = {
        name: entry["version"]
        for name, entry in record.scores.items()
        if identity.is_current(name, entry["version"]) and (name in VERIFIED or headline in entry["values"])
    }
    return identity.flat(_of_kept(job, cell, display, metrics, refine=False, blur=()))


def _of_kept(job: Job, cell: Cell, display: Condition, metrics: Mapping[str, str], **less: Any) -> dict[str, Any]:
    kept = kept_capture(job.store.capture(cell.id))
    image, wanted = kept if len(kept) > 1 else (kept[0], job.target(cell, display))
    return scores_of(job, cell, image, wanted, metrics, **less)


def _second_scores(
    bench: CalibratedBench | RealBench | LearnedBench, capture: RectifiedCapture, target: Tensor
) -> dict[str, float]:
    """PSNR and SSIM of a real photograph, aligned by a second algorithm."""
    image = bench.second_image(capture, target) if isinstance(bench, RealBench) else None
    if image is None:
        return {}
    other_scores = score(image, target, refine=False, blur=(), metrics=("psnr", "ssim"))
    return {f"{name}_linear_second": other_scores[f"{name}_linear"] for name in ("psnr", "ssim")}


def refuse_saturated(capture: RectifiedCapture) -> None:
    """CellError for a capture with too many saturated samples."""
    if capture.saturated > MOST_SATURATED:
        raise CellError(f"{capture.saturated:.2%} of the capture is saturated, more than {MOST_SATURATED:.1%}")


def account(learned: Artifact | None) -> dict[str, Any] | None:
    """The entries of a record about the training of its method."""
    if learned is None:
        return None
    spent = {key: learned.provenance[key] for key in ("sha256", "captures", "seconds")}
    return {**spent, "fell_back": True} if learned.state.get("fell_back") else spent


def keep_pictures(job: Job, cell: Cell, image: Tensor, wanted: Tensor, phase: Tensor) -> None:
    """Write the thumbnail of an image ``(C, h, w)``, and its capture and phase if the study saves them."""
    setting = job.setting
    name = file_name(cell.target) + (f"-{cell.repeat}" if cell.repeat else "") + ".png"
    path = Path(file_name(job.task.label), file_name(cell.condition), name)
    if setting.study.save.captures:
        write_capture(setting.output / "captures" / path, image)
    if setting.study.save.phases:
        write_phase(setting.output / "phases" / path, phase)
    write_thumbnail(job.store.thumbnail(cell.id), match(image, wanted)[0])
