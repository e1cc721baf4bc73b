"""What a prediction explains of the error of a capture, beside the scores of the prediction."""

from __future__ import annotations

from torch import Tensor

from ...display.nominal import ideal_image
from ...metrics import error_budget as budget
from .job import Job, Measured
from .picture import refuse_saturated
from .prediction import AGAIN, ask, further, prediction, shown


def error_budget(job: Job) -> Measured:
    """Predict the capture of a hologram, and compare what leaves how much of it unexplained: the target, the hologram's
    ideal image, the prediction, and a second capture, which has the noise alone; see ``metrics.error_budget``."""
    cell, display = job.task.cells[0], job.task.conditions[0]
    ask(job, cell, display, dict.fromkeys(("", AGAIN, *further(job))))

    def scores(phase: Tensor, target: Tensor, capture: Tensor, predicted: Tensor) -> dict[str, float]:
        _, again = shown(job, cell, display, AGAIN)
        refuse_saturated(again)
        ideal = ideal_image(phase, display.spec)
        return {
            budget.TARGET: budget.unexplained(capture, target, target),
            budget.IDEAL: budget.unexplained(capture, ideal, target),
            budget.PREDICTION: budget.unexplained(capture, predicted, target),
            budget.NOISE: budget.temporal(capture, again.image, target),
            budget.ALGORITHM: budget.unexplained(ideal, target, target),
        }

    return prediction(job, scores)
