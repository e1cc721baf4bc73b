"""What a prediction explains of the error of a capture, beside the scores of the prediction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from torch import Tensor

from ...core.errors import Pending
from ...core.hashing import digest
from ...display.api import ideal_image
from ...metrics import error_budget as budget
from ..displays import Condition
from ..plan import Cell
from .job import Job, Measured
from .picture import refuse_saturated
from .prediction import Foreseen, compared, foresee, shown

# What was found on held-out images, by all that it depends on; for all targets that a process computes.
_found: dict[str, dict[str, float]] = {}


def error_budget(job: Job) -> Measured:
    """Predict the capture of a hologram, and compare what leaves how much of it unexplained: the target, the hologram's
    ideal image, the prediction, and a second capture, which has the noise alone; see ``metrics.error_budget``."""
    cell, display = job.task.cells[0], job.task.conditions[0]
    held_out = _held_out(job, cell)
    _ask_for_all(job, [(cell, False), (cell, True), *((other, False) for other in held_out)], display)

    def scores(seen: Foreseen) -> dict[str, float]:
        _, again = shown(job, cell, display, again=True)
        refuse_saturated(again)
        ideal = ideal_image(seen.phase, display.spec)
        split = _unexplained(seen, ideal)
        split[budget.NOISE] = budget.temporal(seen.capture.image, again.image, seen.target)
        split[budget.ALGORITHM] = budget.unexplained(ideal, seen.target, seen.target)
        return split | _on_held_out(job, held_out, display)

    return compared(job, scores)


def _unexplained(seen: Foreseen, ideal: Tensor) -> dict[str, float]:
    predictions = {budget.TARGET: seen.target, budget.IDEAL: ideal, budget.PREDICTION: seen.prediction}
    return {name: budget.unexplained(seen.capture.image, image, seen.target) for name, image in predictions.items()}


def _on_held_out(job: Job, held_out: list[Cell], display: Condition) -> dict[str, float]:
    """The same on images that only watched the training, over what the target leaves; means over these images."""
    if not held_out:
        return {}
    key = digest([cell.id for cell in held_out])
    if key not in _found:
        seen = [foresee(job, cell, display) for cell in held_out]
        split = [_unexplained(each, ideal_image(each.phase, display.spec)) for each in seen]
        names = {budget.HELD_OUT_IDEAL: budget.IDEAL, budget.HELD_OUT: budget.PREDICTION}
        _found[key] = {
            name: float(np.mean([each[of] / max(each[budget.TARGET], budget.SMALLEST) for each in split]))
            for name, of in names.items()
        }
    return _found[key]


def _held_out(job: Job, cell: Cell) -> list[Cell]:
    """The cell with each image in the place of its target that only watched the training of its method."""
    training = job.task.preparation
    if training is None:
        return []
    there = replace(cell, dataset=training.dataset, dataset_params=training.dataset_params)
    images = training.images[-training.held_out :]
    return [replace(there, target=item, target_sha256=sha256) for item, sha256 in images]


def _ask_for_all(job: Job, photographs: list[tuple[Cell, bool]], display: Condition) -> None:
    """Have all photographs of a bench that other software drives asked for in one round, before any training."""
    waiting: Pending | None = None
    for cell, again in photographs:
        try:
            shown(job, cell, display, again)
        except Pending as error:
            waiting = error
    if waiting is not None:
        raise waiting
