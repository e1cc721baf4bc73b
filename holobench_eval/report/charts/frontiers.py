"""Which charts of quality against cost a study gets, what is in them, and their captions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from ..data.categories import CEILING, ONLINE
from ..data.results import Results
from ..data.tables import DONE, total_captures
from ..data.text import words
from .frontier import Frontier, Line, Mark, draw_frontiers

FEWEST_TIMED = 4
"""Computing time gets a chart from so many timed methods on."""


@dataclass(frozen=True)
class Cost:
    """What quality is drawn against: the figure's file, the axis with its unit, and the words of the caption."""

    file: str
    column: Literal["total_captures", "seconds"]
    axis: str
    said: str


def draw(results: Results, folder: Path) -> Iterator[tuple[Path, str]]:
    """Draw what the study has; (file, caption) of each."""
    each = results.layout.wording.each
    captures = Cost(
        "quality-captures.png",
        "total_captures",
        "captures in total, of training and of all targets (logarithmic; zero left of the break)",
        "all captures that a row of the study took: those of its training once, and those of every target",
    )
    seconds = Cost(
        "quality-time.png", "seconds", f"computing time per {each} [s] (logarithmic)", f"computing time per {each}"
    )
    for cost, wanted in ((captures, _spent), (seconds, _timed)):
        panels = [panel for condition in results.conditions if (panel := _panel(results, condition, cost)).marks]
        if panels and wanted(results, panels):
            path = folder / cost.file
            draw_frontiers(path, panels, f"{results.headline.axis}{results.layout.wording.axis}", cost.axis)
            yield path, _caption(results, panels, cost)


def _spent(results: Results, panels: list[Frontier]) -> bool:
    return results.layout.spends_captures and any(mark.cost > 0 for panel in panels for mark in panel.marks)


def _timed(_: Results, panels: list[Frontier]) -> bool:
    return len({mark.label for panel in panels for mark in panel.marks}) >= FEWEST_TIMED


def _panel(results: Results, condition: str, cost: Cost) -> Frontier:
    """A display's panel; a method that lacks a target has no mean to compare, and is not in it."""
    registered = results.frame.drop_duplicates("method").set_index("method")["name"]
    marks = tuple(
        Mark(
            label=name,
            group=str(registered[name]),
            track=results.layout.track(name),
            cost=spent,
            quality=float(results.values(name, condition).mean()),
            **_interval(results, name, condition),
        )
        for name in results.methods(condition)
        if results.layout.track(name) != CEILING and results.whole(name, condition)
        if np.isfinite(spent := _cost(results, name, condition, cost)) and (spent > 0 or cost.column != "seconds")
    )
    baseline, ceiling = results.layout.baseline, results.ceiling(condition)
    floor = baseline if baseline in results.methods(condition) and results.whole(baseline, condition) else None
    return Frontier(
        condition,
        marks,
        higher=results.headline.higher_is_better,
        floor=_line(results, floor, condition, "baseline", band=False) if floor else None,
        ceiling=_line(results, ceiling, condition, "ceiling", band=True) if ceiling else None,
    )


def _cost(results: Results, name: str, condition: str, cost: Cost) -> float:
    if cost.column == "seconds":
        return float(results.row(name, condition)["seconds"])
    cells = results.cells(name, condition)
    return total_captures(cells[cells["state"] == DONE])


def _interval(results: Results, name: str, condition: str) -> dict[str, float]:
    """Ends of the bar of a method: of its mean difference to the baseline, moved to its mean; else of the mean."""
    gained = results.gain(name, condition)
    if gained is None:
        row, key = results.row(name, condition), results.headline.key
        return {"low": float(row[f"{key}_lo"]), "high": float(row[f"{key}_hi"])}
    mean = float(results.values(name, condition).mean())
    if name == results.layout.baseline:
        return {"low": float("nan"), "high": float("nan")}
    return {"low": mean + gained.low - gained.mean, "high": mean + gained.high - gained.mean}


def _line(results: Results, name: str, condition: str, role: str, band: bool) -> Line:
    mean = float(results.values(name, condition).mean())
    ends = _interval(results, name, condition) if band else {}
    return Line(f"{role}: {name}, {results.headline.with_unit(mean)}", mean, **ends)


def _caption(results: Results, panels: list[Frontier], cost: Cost) -> str:
    """What is drawn, what the bars are, and who is missing."""
    sentences = [f"{results.headline.axis}{results.layout.wording.axis}, against {cost.said}."]
    sentences.append(
        "A line joins the rows of one registered method. Pale steps: the best that is to be had for a cost"
        f"{', apart for methods with and without the camera for the scored image' * (ONLINE in results.tracks)}."
    )
    if any(panel.floor for panel in panels):
        sentences.append(
            "Bars: 95 % interval of the mean difference to the baseline, target by target, so that a bar clear of the "
            "baseline's line is a difference; intervals of the means themselves stand in the tables."
        )
    else:
        sentences.append("Bars: 95 % interval of the mean over targets.")
    if any(panel.ceiling for panel in panels):
        sentences.append("The upper line is the privileged ceiling, with its interval as a band.")
    lacking = sorted(
        {
            name
            for condition in results.conditions
            for name in results.methods(condition)
            if not results.whole(name, condition)
        }
    )
    if lacking:
        sentences.append(f"Left out where they lack a target: {words(lacking)}.")
    return " ".join(sentences)
