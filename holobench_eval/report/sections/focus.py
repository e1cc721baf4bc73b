"""Focal stacks plane by plane, and light fields place by place."""

from __future__ import annotations

import numpy as np

from ..answers.focus import made_of, seconds
from ..facts import PLACES
from ..markdown import Markdown, heading, table_of
from ..phrases import marked
from ..results import Results
from ..section import Blocks, Figures, Report, Section
from ..statistics import Array, Estimate, mean_interval
from ..text import number


def _render(report: Report, _: Figures) -> Blocks:
    title, explanation = WORDS[report.results.study.measure]
    yield heading(title)
    yield f"{report.results.headline.axis}, mean over scenes. {explanation}"
    for condition in report.results.conditions:
        yield heading(condition, 3)
        yield by_plane(report.results, condition)


WORDS = {
    "focus": (
        "Plane by plane",
        "Planes are given in mm from the image distance of the full panel, positive away from the panel, and scale "
        "with the panel. A scene takes one hologram per plane, or one of all planes.",
    ),
    "views": (
        "Place by place of the eye's pupil",
        "Places are given in radii of the iris, sideways from the axis. A scene takes one hologram.",
    ),
}


def planes(results: Results) -> list[float]:
    """The planes [mm], nearest to the panel first, or the places of the eye's pupil from left to right."""
    return sorted({*results.facts.targets["place"]})


def by_plane(results: Results, condition: str) -> Markdown | None:
    """Mean over scenes at every plane, and seconds."""
    score, rows = results.headline, []
    unit, places = (" mm", "planes") if results.study.measure == "focus" else ("", "places")
    for name in results.methods(condition):
        values = results.values(name, condition)
        row = {"method": marked(results, name, condition), "hologram of": made_of(results, name)}
        row |= {f"{plane:g}{unit}": score.estimate(_at(results, values, plane)) for plane in planes(results)}
        row |= {f"all {places}": score.number(float(np.mean(values)))}
        row |= {"seconds a hologram": number(float(results.rows[name, condition]["solving_s"]))}
        rows.append(row | {"seconds a scene": number(seconds(results, name, condition))})
    return table_of(rows)


def _at(results: Results, values: Array, plane: float) -> Estimate:
    """Mean of those of ``(targets,)`` values that belong to a plane, a value per scene."""
    return mean_interval(values[(results.facts.targets["place"].reindex(results.targets) == plane).to_numpy()])


SECTIONS = (Section("focus", 70, _render, applies=lambda report: report.results.study.measure in PLACES, details=True),)
