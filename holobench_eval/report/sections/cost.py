"""Charts of quality against what it cost: captures, and seconds."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..charts.frontier import Frontier, Line, Mark, draw_frontiers
from ..charts.look.methods import looks
from ..data.categories import ONLINE, ORACLE
from ..data.phrases import CONSTANT
from ..data.results import Results
from ..data.text import words
from ..section import Section

FEWEST_TIMED = 4  # computing time gets a chart from so many timed methods on


Spent = Callable[[Results, str, str], float]  # what a method spent under a condition


@dataclass(frozen=True)
class Cost:
    """What quality is drawn against: the figure's file, the axis with its unit, and the words of the caption."""

    file: str
    spent: Spent
    axis: str
    words: str


def draw(results: Results, folder: Path) -> Iterator[tuple[Path, str]]:
    """Draw quality against captures and seconds, where the study has enough of them; (file, caption) of each."""
    each = f"computing time per {results.layout.text.each}"
    captures = Cost(
        "quality-captures.png",
        _captures,
        "captures in total, of training and of all targets (logarithmic; zero left of the break)",
        "all captures of a row: those of its training once, and those of every target",
    )
    seconds = Cost("quality-time.png", _seconds, f"{each} [s] (logarithmic)", each)
    for cost, wanted in ((captures, _spends_captures), (seconds, _times_enough)):
        panels = [panel for condition in results.conditions if (panel := _frontier(results, condition, cost)).marks]
        if panels and wanted(results, [mark for panel in panels for mark in panel.marks]):
            path = folder / cost.file
            axis = f"{results.headline.axis}{results.layout.text.axis}"
            draw_frontiers(path, panels, axis, cost.axis, looks(results.names))
            yield path, _caption(results, panels, cost)


def _captures(results: Results, name: str, condition: str) -> float:
    return float(results.row(name, condition)["total_captures"])


def _seconds(results: Results, name: str, condition: str) -> float:
    """NaN without any, since there is no logarithm of zero."""
    return float(results.row(name, condition)["solving_s"]) or float("nan")


def _spends_captures(results: Results, marks: list[Mark]) -> bool:
    return results.layout.spends_captures and any(mark.cost > 0 for mark in marks)


def _times_enough(_: Results, marks: list[Mark]) -> bool:
    return len({mark.label for mark in marks}) >= FEWEST_TIMED


def _frontier(results: Results, condition: str, cost: Cost) -> Frontier:
    """A display's panel; a method that lacks a target has no mean to compare, and is not in it."""
    marks = tuple(
        Mark(
            label=name,
            group=results.names[name],
            category=results.layout.category(name),
            cost=spent,
            quality=float(results.values(name, condition).mean()),
            captures=_captures(results, name, condition),
            **_ends(results, name, condition),
        )
        for name in results.methods(condition)
        if results.layout.category(name) != ORACLE and results.is_complete(name, condition)
        if np.isfinite(spent := cost.spent(results, name, condition))
    )
    baseline, oracle = results.layout.baseline, results.oracle(condition)
    known = baseline in results.methods(condition) and results.is_complete(str(baseline), condition)
    has_constant = CONSTANT in results.floors and results.has_pictures(condition)
    return Frontier(
        condition,
        marks,
        higher=results.headline.higher_is_better,
        baseline=_line(results, str(baseline), condition, "baseline", band=False) if known else None,
        oracle=_line(results, oracle, condition, "oracle", band=True) if oracle else None,
        constant=_constant(results, condition) if has_constant else None,
    )


def _ends(results: Results, name: str, condition: str) -> dict[str, float]:
    """Ends of the bar of a method: of its mean difference to the baseline, moved to its mean; else of the mean."""
    gained = results.gain(name, condition)
    if gained is None:
        own = results.headline.of(results.row(name, condition))
        return {"low": own.low, "high": own.high}
    mean = float(results.values(name, condition).mean())
    if name == results.layout.baseline:
        return {"low": float("nan"), "high": float("nan")}
    return {"low": mean + gained.low - gained.mean, "high": mean + gained.high - gained.mean}


def _line(results: Results, name: str, condition: str, role: str, band: bool) -> Line:
    mean = float(results.values(name, condition).mean())
    ends = _ends(results, name, condition) if band else {}
    return Line(f"{role}: {name}, {results.headline.with_unit(mean)}", mean, **ends)


def _constant(results: Results, condition: str) -> Line:
    """The floor: the mean of a constant image."""
    mean = float(results.row(CONSTANT, results.reference(condition))[results.headline.column])
    return Line(f"constant image, {results.headline.with_unit(mean)}", mean)


def _caption(results: Results, panels: list[Frontier], cost: Cost) -> str:
    """What is drawn, what the bars are, and who is missing."""
    online = ", separately for methods with and without the camera for the scored image"
    sentences = [
        f"{results.headline.axis}{results.layout.text.axis}, against {cost.words}.",
        "Lines join rows of one method that differ in their captures.",
        f"Pale steps: the best quality for a cost{online * (ONLINE in results.categories)}.",
    ]
    if any(panel.baseline for panel in panels):
        sentences.append(
            "Bars: 95 % interval of the paired mean difference to the baseline; a bar clear of the baseline's line is "
            "a difference. The tables hold the intervals of the means themselves."
        )
    else:
        sentences.append("Bars: 95 % interval of the mean over targets.")
    if any(panel.oracle for panel in panels):
        sentences.append("The upper line is the oracle, with its interval as a band.")
    rows = [(name, condition) for condition in results.conditions for name in results.methods(condition)]
    lacking = sorted({name for name, condition in rows if not results.is_complete(name, condition)})
    if lacking:
        sentences.append(f"Omitted where a target is missing: {words(lacking)}.")
    return " ".join(sentences)


SECTIONS = (
    Section(
        "cost",
        40,
        lambda _, figures: figures,
        figures=lambda report: draw(report.results, report.figures),
        details=True,
    ),
)
