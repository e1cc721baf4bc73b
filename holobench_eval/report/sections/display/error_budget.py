"""Where the error of a display's captures comes from: the first question of a lab, and why a method wins."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from ...charts.error_budget import draw_budgets
from ...data.error_budget import Budget, Part, budgets
from ...data.statistics import Estimate
from ...data.text import words
from ...markdown import Markdown, blocks, bullets, heading, table
from ...section import Blocks, Figures, Report, Section


def _render(report: Report, figures: Figures) -> Blocks:
    found = budgets(report.results)
    yield heading("The error budget")
    yield (
        "The squared error of the captures against their targets, in linear light and at matched brightness, in parts: "
        "what each prediction of a capture explains of it that none before it did. A prediction is what a model makes "
        "of the hologram that was shown; models were trained on captures of other images."
    )
    yield bullets(reading(budget, report.layout.holograms.partition(" (")[0]) for budget in found)
    yield from figures
    if not found:
        yield "No display has the scores of all methods for all targets, so none has a budget."
        return
    for budget in found:
        yield blocks([heading(budget.condition, 3), _table(budget)])
        yield bullets(remarks(budget))
    yield HOW


HOW = (
    "Parts are differences between one prediction and the next and add up to the whole. Each line stands for the best "
    "of its own prediction and of those above it, chosen by captures of the held-out images of the training: a part is "
    "below zero where what was learned does not hold for the targets. Shares are those of a target's error, decibels "
    "those of its PSNR, and both are means over targets. Temporal noise comes from a second capture of every hologram. "
    "Decibels are upper bounds: where light is missing, or a picture cannot be darker, no hologram removes what is "
    "explained, and a hologram that removes it is another one, whose rest may differ. A larger model, or more "
    "captures, may explain more."
)


def reading(budget: Budget, holograms: str) -> Markdown:
    """The paragraph that reads a budget."""
    ideal, *models = budget.explained
    gains = [f"{_decibel(part.gain)} for {part.label}" for part in models]
    shares = [f"{_percent(part)} {part.label}" for part in (*models, budget.rest, budget.noise)]
    return Markdown("**{}.** {}").format(
        budget.condition,
        f"The captures of {holograms} holograms have {_decibel(budget.psnr)} over {budget.targets} targets. The ideal "
        f"images of these holograms have {_decibel(budget.ideal_psnr)}, and what they explain of the captures' error "
        f"is worth {_decibel(ideal.gain)}: more a better algorithm for the ideal display cannot gain. Removing all "
        f"that is explained can gain at most {words(gains)}. {_limit(budget)} "
        f"By parts: {_percent(ideal)} {ideal.label}, {words(shares)}.",
    )


def _limit(budget: Budget) -> str:
    gain = budget.noise.gain
    return "There is no temporal noise." if gain is None else f"Temporal noise allows no more than {_decibel(gain)}."


def remarks(budget: Budget) -> list[str]:
    """Sentences on links that an earlier prediction stands for, and on parts below zero."""
    lines = [
        f"{part.label} predicts the held-out captures no better than {part.stands}, which stands for it."
        for part in budget.explained
        if part.stands != part.label
    ]
    below = [part.label for part in budget.explained if part.share.mean < 0]
    return [*lines, f"Below zero, worse on the targets than on held-out images: {words(below)}."] if below else lines


def _table(budget: Budget) -> Markdown:
    rows = [[part.label, _interval(part.share, 100, 1), _decibel(part.gain, unit="")] for part in budget.parts]
    return table(["explained by", "share of the squared error [%]", "PSNR gained at most, with all above [dB]"], rows)


def _decibel(gain: Estimate | None, unit: str = " dB") -> str:
    return "–" if gain is None else f"{_interval(gain, 1, 2)}{unit}"


def _interval(estimate: Estimate, factor: float, digits: int) -> str:
    mean, low, high = (f"{factor * value:z.{digits}f}" for value in (estimate.mean, estimate.low, estimate.high))
    return mean if low == "nan" else f"{mean} [{low}, {high}]"


def _percent(part: Part) -> str:
    return f"{100 * part.share.mean:z.0f} %"


def _figures(report: Report) -> Iterator[tuple[Path, str]]:
    found = budgets(report.results)
    if found:
        path = report.figures / "error-budget.png"
        draw_budgets(path, found)
        yield (
            path,
            "The error budget. Left: parts of the squared error of the captures, by display, with their PSNR. Right: "
            "what removing a part and all parts to its left would gain at most, with its 95 % interval over targets; "
            "for temporal noise, what captures with no other error would gain.",
        )


SECTIONS = (
    Section(
        "error budget",
        5,
        _render,
        applies=lambda report: report.layout.measure == "error_budget" and bool(report.results.conditions),
        figures=_figures,
    ),
)
