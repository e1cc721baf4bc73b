"""What a prediction explains of the error of a capture, beside the scores of the prediction."""

from __future__ import annotations

from ...display.nominal import ideal_image
from ...metrics import error_budget as budget
from .job import Job, Measured
from .picture import refuse_saturated
from .prediction import AGAIN, Foreseen, ask, compared, further, shown


def error_budget(job: Job) -> Measured:
    """Predict the capture of a hologram, and compare what leaves how much of it unexplained: the target, the hologram's
    ideal image, the prediction, and a second capture, which has the noise alone; see ``metrics.error_budget``."""
    cell, display = job.task.cells[0], job.task.conditions[0]
    ask(job, cell, display, dict.fromkeys(("", AGAIN, *further(job))))

    def scores(seen: Foreseen) -> dict[str, float]:
        _, again = shown(job, cell, display, AGAIN)
        refuse_saturated(again)
        ideal, capture = ideal_image(seen.hologram.phase, display.spec), seen.capture.image
        return {
            budget.TARGET: budget.unexplained(capture, seen.target, seen.target),
            budget.IDEAL: budget.unexplained(capture, ideal, seen.target),
            budget.PREDICTION: budget.unexplained(capture, seen.prediction, seen.target),
            budget.NOISE: budget.temporal(capture, again.image, seen.target),
            budget.ALGORITHM: budget.unexplained(ideal, seen.target, seen.target),
        }

    return compared(job, scores)
