"""Where the error of a display's captures comes from: the first question of a lab, and why a method wins."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from ...charts.error_budget import draw_budgets
from ...data.error_budget import Budget, budgets
from ...data.statistics import Estimate
from ...data.text import words
from ...markdown import Markdown, blocks, bullets, heading, table
from ...section import Blocks, Figures, Report, Section


def _render(report: Report, _: Figures) -> Blocks:
    found = budgets(report.results)
    yield heading("The error budget")
    yield (
        "The squared error of the captures against their targets, in linear light and at matched brightness, in parts: "
        "what each prediction of a capture explains of it that none before it did. A prediction is what a model makes "
        "of the hologram that was shown; models were trained on captures of other images."
    )
    yield bullets(reading(budget, report.layout.holograms.partition(" (")[0]) for budget in found)
    if not found:
        yield "No display has the scores of all methods for all targets, so none has a budget."
        return
    for budget in found:
        yield blocks([heading(budget.condition, 3), _table(budget)])
    yield HOW


HOW = (
    "Parts are differences between one prediction and the next and add up to the whole. Each line stands, target by "
    "target, for the best of its own prediction and of those above it: a bound, as if it were known which to believe. "
    "The last column is what a prediction leaves by itself; where it is more than the line above leaves, what was "
    "learned does not hold for some targets. Shares are those of a target's error, decibels those of its PSNR, and "
    "both are means over targets, with intervals over their clusters. Temporal noise comes from a second capture of "
    "every hologram, and what it allows is a mean over the targets that have any. Decibels are upper "
    "bounds: where light is missing, or a picture cannot be darker, no hologram removes what is explained, and a "
    "hologram that removes it is another one, whose rest may differ. A larger model, or more captures, may explain "
    "more."
)


def reading(budget: Budget, holograms: str) -> Markdown:
    """The paragraph that reads a budget."""
    ideal, *models = budget.explained
    first, *others = [(part.label, _decibel(part.gain)) for part in models]
    bounds = [f"{first[0]} can gain at most {first[1]}", *(f"{label} {gain}" for label, gain in others)]
    shares = [f"{100 * part.share.mean:z.0f} % {part.label}" for part in budget.parts]
    return Markdown("**{}.** {}").format(
        budget.condition,
        f"The captures of {holograms} holograms have {_decibel(budget.psnr)} over {budget.psnr.n} targets. The ideal "
        f"images of these holograms have {_decibel(budget.ideal_psnr)}, and what they explain of the captures' error "
        f"is worth {_decibel(ideal.gain)}: a better algorithm for the ideal display cannot gain more. By removing what "
        f"they explain, {words(bounds)}. {_limit(budget)} By parts: {words(shares)}.",
    )


def _limit(budget: Budget) -> str:
    gain = budget.noise.gain
    if gain is None:
        return "There is no temporal noise."
    some = f" over the {gain.n} of {budget.psnr.n} targets that have any" if gain.n < budget.psnr.n else ""
    return f"Temporal noise allows no more than {_decibel(gain)}{some}."


def _table(budget: Budget) -> Markdown:
    rows = [
        [part.label, _percent(part.share, 1), _decibel(part.gain, unit=""), _percent(part.alone, 1)]
        for part in budget.parts
    ]
    gained, left = "PSNR gained at most, with all above [dB]", "left by it alone [%]"
    return table(["explained by", "share of the squared error [%]", gained, left], rows)


def _decibel(gain: Estimate | None, unit: str = " dB") -> str:
    return "–" if gain is None else f"{_interval(gain, 1, 2)}{unit}"


def _interval(estimate: Estimate, factor: float, digits: int) -> str:
    mean, low, high = (f"{factor * value:z.{digits}f}" for value in (estimate.mean, estimate.low, estimate.high))
    return mean if low == "nan" else f"{mean} [{low}, {high}]"


def _percent(share: Estimate | None, digits: int) -> str:
    return "–" if share is None else _interval(share, 100, digits)


def _figures(report: Report) -> Iterator[tuple[Path, str]]:
    found = budgets(report.results)
    if found:
        path = report.figures / "error-budget.png"
        draw_budgets(path, found)
        yield (
            path,
            "The error budget. Left: parts of the squared error of the captures, by display, with their PSNR. Right: "
            "what removing a part and all parts to its left would gain at most, with its 95 % interval over clusters; "
            "for temporal noise, what captures with no other error would gain.",
        )


def _applies(report: Report) -> bool:
    return report.layout.measure == "error_budget" and bool(report.results.conditions)


SECTIONS = (
    Section("error budget, drawn", 5, lambda _, figures: figures, applies=_applies, figures=_figures),
    Section("error budget", 5, _render, applies=_applies, details=True),
)
