"""The leaderboard: what each method reaches on a display, and what that cost in captures, time and memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..charts.frontier import Frontier, Line, Mark, draw_frontiers
from ..charts.look.methods import looks
from ..data.categories import CATEGORIES, ONLINE, ORACLE, meanings
from ..data.columns import costs
from ..data.phrases import CONSTANT, marked
from ..data.results import Results
from ..data.text import number, percent, words
from ..markdown import Markdown, bullets, heading, table
from ..section import Blocks, Figures, Report, Section

FEWEST_TIMED = 4  # computing time gets a chart from so many timed methods on


def _render(report: Report, figures: Figures) -> Blocks:
    results, tables = report.results, report.by_display(leaderboard)
    if tables:
        yield heading("Quality and what it cost")
        yield "Methods compete in tracks, by their access to the camera:"
        yield bullets(
            Markdown("**{}**: {}").format(category, meaning) for category, meaning in meanings(results.categories)
        )
        yield reading(results)
        yield tables
    yield from figures


def leaderboard(results: Results, condition: str) -> Markdown | None:
    """The table of a display; none for a study without captures."""
    if not results.layout.spends_captures:
        return None
    names = _order(results, condition)
    closed = {name: results.gap_closed(name, condition) for name in names}
    gap = ["way to the ceiling [%]"] if any(closed.values()) else []
    known = costs(results.table, results.layout.text.each)
    beside = [score.name for score in results.beside]
    rows = []
    for name in names:
        row = results.row(name, condition)
        rows.append(
            [
                results.layout.category(name),
                "–" if np.isnan(row["rank"]) else f"{row['rank']:.0f}",
                marked(results, name, condition),
                f"{row['n']:.0f} of {len(results.targets)}",
                results.headline.in_row(row),
                *(score.mean_in(row) for score in results.beside),
                *([percent(closed[name])] if gap else []),
                *(number(row[key]) for key in known),
            ]
        )
    return table(["track", "rank", "method", "n", results.headline.axis, *beside, *gap, *known.values()], rows)


def _order(results: Results, condition: str) -> list[str]:
    """Methods category by category, best mean first; those that lack targets last in their category."""

    def position(name: str) -> tuple[int, float]:
        rank = results.row(name, condition)["rank"]
        return CATEGORIES.index(results.layout.category(name)), np.inf if np.isnan(rank) else rank

    return sorted(results.methods(condition), key=position)


def reading(results: Results) -> str:
    """How the columns of the leaderboard are to be read."""
    each = results.layout.text.each
    sentences = [
        "Ranks order the means of the headline within a display and a track; a method that lacks a target has no rank.",
        "Captures in total are those of the training and of every target.",
        f"Seconds of training are spent once, seconds per {each} on every image.",
    ]
    if results.layout.baseline and any(results.oracle(condition) for condition in results.conditions):
        sentences.append(
            f'"Way to the ceiling" is the share of the gap between the baseline {results.layout.baseline} and the '
            "oracle, the best privileged method, that a method closes, by means of the headline; in brackets its "
            "interval."
        )
    if ONLINE in results.categories:
        sentences.append(
            "Methods that capture the scored image compete in a track of their own: a camera for every image makes "
            "more possible, and their scores do not apply to a display without one."
        )
    return " ".join(sentences)


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
        oracle=_line(results, oracle, condition, "ceiling", band=True) if oracle else None,
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
    Section("leaderboard", 40, _render, figures=lambda report: draw(report.results, report.figures), details=True),
)
