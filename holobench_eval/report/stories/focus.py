"""Focal stacks and light fields: one hologram of all planes or views of a scene against what knows of one."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from ..board import Board
from ..facts import PLACES
from ..markdown import Markdown, heading, table_of
from ..phrases import marked, value
from ..results import Results
from ..statistics import mean_interval
from ..story import Blocks, Figures, Part, Report, subjects
from ..text import number
from .comparison import compared

ORDER = 40
QUESTION = "What does a hologram of all planes or views of a scene gain over that of one, and what does it cost?"
SECONDS = "processor seconds a scene"
LIMITS = ("Scenes: planes or views of a scene are not independent, so intervals and tests are over scenes.",)

# By measure: what a hologram is made of that knows of all and that knows of one; the title of the details; what their
# columns are, and in which unit; and what must be known of these.
WORDS: Mapping[str, tuple[tuple[str, str], str, tuple[str, str], str]] = {
    "focus": (
        ("all planes", "one plane"),
        "Plane by plane",
        ("planes", " mm"),
        "Planes are given in mm from the image distance of the full panel, positive away from the panel, and scale "
        "with the panel. A scene takes one hologram per plane, or one of all planes.",
    ),
    "views": (
        ("all views", "the middle view"),
        "Place by place of the eye's pupil",
        ("places", ""),
        "Places are given in radii of the iris, sideways from the axis. A scene takes one hologram.",
    ),
}


def applies(results: Results) -> bool:
    """Whether the targets are planes or views of scenes."""
    return results.study.measure in PLACES


def verdicts(results: Results) -> Iterator[str]:
    """One a display: the methods that receive all planes or views, or that the question names, best first."""
    at_once = results.facts.labels("stacked")
    chosen = dict.fromkeys([*(label for label in results.labels if label in at_once), *subjects(results)])
    for condition in results.conditions:
        tests = [test for label in chosen if (test := results.tested(label, condition))]
        sentences = [*compared(results, tests)]
        if not sentences:
            means = [f"{label} {value(results, label, condition)}" for label in results.methods(condition)]
            sentences = [f"{', '.join(means)}."] * bool(means)
        yield f"{f'{condition}: ' * (len(results.conditions) > 1)}{' '.join(sentences)}" * bool(sentences)


def _made_of(results: Results, label: str) -> str:
    """What a hologram of a method is made of."""
    every, single = WORDS[results.study.measure][0]
    return every if label in results.facts.labels("stacked") else single


def _planes(results: Results) -> list[float]:
    """The planes [mm], nearest to the panel first, or the places of the eye's pupil from left to right."""
    return sorted({plane for _, plane in results.facts.targets[["scene", "place"]].itertuples(index=False)})


def _seconds(results: Results, label: str, condition: str) -> dict[str, str]:
    """Computing time of a hologram and of a scene, of all processors [s]."""
    once = label in results.facts.labels("stacked") or results.study.measure == "views"
    hologram = float(results.rows[label, condition].get("cpu_s", math.nan))
    scene = hologram * (1 if once else len(_planes(results)))
    return {"processor seconds a hologram": number(hologram), SECONDS: number(scene)}


def table(board: Board) -> Markdown | None:
    """A row a method and display: score over all planes or views, difference to the baseline, processor seconds
    a scene."""
    results, rows = board.results, []
    score, baseline = results.headline, results.baseline
    for label, condition in ((label, name) for name in results.conditions for label in results.methods(name)):
        row = {"method": marked(results, label, condition), "display": condition}
        row |= {"hologram of": _made_of(results, label), score.heading: score.in_row(results.rows[label, condition])}
        if baseline:
            test = results.tested(label, condition)
            row[f"difference to {baseline}"] = score.estimate(test.estimate if test else None, signed=True)
        rows.append(row | {SECONDS: _seconds(results, label, condition)[SECONDS]})
    return table_of(rows)


def _render(report: Report, figures: Figures) -> Blocks:
    _, title, _, explanation = WORDS[report.results.study.measure]
    yield heading(title)
    yield f"{report.results.headline.axis}, mean over scenes. {explanation}"
    for condition in report.results.conditions:
        yield heading(condition, 3)
        yield by_plane(report.results, condition)


def by_plane(results: Results, condition: str) -> Markdown | None:
    """Mean over scenes at every plane, a row a method, and seconds."""
    score, rows, place = results.headline, [], results.facts.targets["place"].reindex(results.targets)
    places, unit = WORDS[results.study.measure][2]
    for label in results.methods(condition):
        values = results.values(label, condition)
        row = {"method": marked(results, label, condition), "hologram of": _made_of(results, label)}
        for plane in _planes(results):
            here = values[(place == plane).to_numpy()]
            row[f"{plane:g}{unit}"] = score.estimate(mean_interval(here))
        row[f"all {places}"] = score.number(float(values.mean()))
        rows.append(row | _seconds(results, label, condition))
    return table_of(rows)


PARTS = (Part(70, _render, applies=lambda report: applies(report.results), details=True),)
