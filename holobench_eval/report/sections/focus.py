"""Focal stacks plane by plane, and light fields place by place."""

from __future__ import annotations

import numpy as np

from ..answers.focus import made_of, seconds
from ..data.phrases import marked
from ..data.results import Results
from ..data.statistics import Array, Estimate, mean_interval
from ..data.text import number
from ..markdown import Markdown, heading, table_of
from ..section import Blocks, Figures, Report, Section


def _render(report: Report, _: Figures) -> Blocks:
    title, explanation = WORDS[report.layout.measure]
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
    return sorted({plane for _, plane in results.layout.planes.values()})


def by_plane(results: Results, condition: str) -> Markdown | None:
    """Mean over scenes at every plane, and seconds."""
    score, rows = results.headline, []
    unit, places = (" mm", "planes") if results.layout.measure == "focus" else ("", "places")
    for name in results.methods(condition):
        values = results.values(name, condition)
        row = {"method": marked(results, name, condition), "hologram of": made_of(results, name)}
        row |= {f"{plane:g}{unit}": score.estimate(_at(results, values, plane)) for plane in planes(results)}
        row |= {f"all {places}": score.number(float(np.mean(values)))}
        row |= {"seconds a hologram": number(float(results.row(name, condition)["solving_s"]))}
        rows.append(row | {"seconds a scene": number(seconds(results, name, condition))})
    return table_of(rows)


def _at(results: Results, values: Array, plane: float) -> Estimate:
    """Mean of those of ``(targets,)`` values that belong to a plane, a value per scene."""
    return mean_interval(values[[results.layout.planes[target][1] == plane for target in results.targets]])


SECTIONS = (Section("focus", 70, _render, applies=lambda report: bool(report.layout.planes), details=True),)
