"""Training: what was learned, from how many captures, and how well captures of held-out images were foreseen."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from ..charts.curves import draw_trainings
from ..data.trainings import DISPLAY, Training
from ..facts import Facts
from ..markdown import Markdown, bullets, heading, table_of
from ..section import Blocks, Figures, Report, Section
from ..text import number, words

DIGITS = 10  # of a sha256 that are printed


def _render(report: Report, figures: Figures) -> Blocks:
    yield heading("Training")
    yield (
        "Training took place before any target was seen. Held-out images only monitor it; their captures and their "
        "time are counted."
    )
    yield _summary(report.results.facts, report.trainings)
    yield bullets(_doubts(report.trainings))
    rounds = _rounds(report.trainings)
    if rounds:
        yield (
            "Held-out images after every round, matched in intensity. Predicted: the method's prediction against the "
            "target. Captured: the capture against the target. Fidelity: the prediction against the capture. Where "
            "predicted exceeds captured, the prediction promises more than the display shows."
        )
    yield rounds or "No figures on held-out images were logged."
    yield from figures


def _summary(facts: Facts, trainings: Sequence[Training]) -> Markdown | None:
    """What each training took."""
    given, features = facts.training, any(training.text("perceptual") for training in trainings)
    images, held_out = (given.images - given.held_out, given.held_out) if given else ("–", "–")
    return table_of(
        [
            {
                "method": training.name,
                "trained on": training.display,
                "captures": number(training.number("captures")),
                "seconds": number(training.number("seconds")),
                "images": images,
                "held out": held_out,
                "rounds": (len(training.record.rounds) or "–") if training.record else "–",
                **({"perceptual features": training.text("perceptual") or "none"} if features else {}),
                "learned state, sha256": training.text("sha256")[:DIGITS] or "not trained",
            }
            for training in trainings
        ]
    )


def _rounds(trainings: Sequence[Training]) -> Markdown | None:
    """Every round of every training on held-out images; none where no method logged any."""
    rows = []
    for training in trainings:
        for step in training.record.rounds if training.record else ():
            figures = {
                "PSNR, predicted [dB]": step.predicted,
                "PSNR, captured [dB]": step.captured,
                "fidelity [dB]": step.fidelity,
            }
            if not all(map(math.isnan, figures.values())):
                row = {"method": training.name, "round": step.number}
                row |= {"captures so far": number(step.captures), "seconds so far": number(step.seconds)}
                rows.append(row | {name: "–" if math.isnan(db) else f"{db:.2f}" for name, db in figures.items()})
    return table_of(rows)


def _doubts(trainings: Sequence[Training]) -> list[str]:
    """Sentences on trainings that are missing beside the report, are not those that its scores come from, or give a
    method the display itself."""
    lines = []
    for training in trainings:
        name, used = training.name, training.used
        if DISPLAY in training.labels[1:]:
            own = words([label for label in training.labels if label != DISPLAY])
            lines.append(f"{own} solves through the network that is the display, and so knows the display exactly.")
        if training.record is None:
            lines.append(f"Nothing is known of the training of {name}: it failed, or its log is not in this folder.")
        elif used and training.text("sha256") not in used:
            lines.append(f"The figures for {name} here and its scores come from different trainings.")
        if lacks := training.text("left_out"):
            lines.append(f"The region is too small for all of the retrieval's loss: {name} has it without {lacks}.")
        if outdated := training.text("in_the_place_of"):
            lines.append(f"{name} was trained anew: {outdated}.")
        if len(used) > 1:
            lines.append(f"The scores of {name} come from {len(used)} different trainings.")
    return lines


def _figures(report: Report) -> Iterator[tuple[Path, str]]:
    rounds = [(training.name, training.record.rounds) for training in report.trainings if training.record]
    for path in draw_trainings(report.figures / "training", rounds):
        yield (
            path,
            "Training: PSNR on held-out images of the predicted and of the captured picture against the target, and "
            "of the prediction against the capture (fidelity), against the captures taken, a mark per round.",
        )


SECTIONS = (Section("training", 100, _render, lambda report: bool(report.trainings), figures=_figures, details=True),)
