"""Focal stacks, plane by plane."""

from __future__ import annotations

import numpy as np

from ..data.phrases import marked
from ..data.results import Results
from ..data.statistics import Array, Estimate, mean_interval
from ..data.text import number
from ..markdown import Markdown, heading, table
from ..section import Blocks, Figures, Report, Section


def _render(report: Report, _: Figures) -> Blocks:
    yield heading("Plane by plane")
    yield (
        f"{report.results.headline.axis}, mean over scenes. Planes are given in mm from the image distance of the "
        "full panel, positive away from the panel, and scale with the panel. A scene takes one hologram per plane, or "
        "one of all planes."
    )
    for condition in report.results.conditions:
        yield heading(condition, 3)
        yield by_plane(report.results, condition)


def planes(results: Results) -> list[float]:
    """The planes [mm], nearest to the panel first."""
    return sorted({plane for _, plane in results.layout.planes.values()})


def by_plane(results: Results, condition: str) -> Markdown:
    """Mean over scenes at every plane, and seconds."""
    score, distances = results.headline, planes(results)
    columns = ["method", "hologram of", *(f"{plane:g} mm" for plane in distances), "all planes"]
    rows = []
    for name in results.methods(condition):
        values, stacked = results.values(name, condition), name in results.layout.stacked
        estimates = [_at(results, values, plane) for plane in distances]
        seconds = float(results.row(name, condition)["solving_s"])
        rows.append(
            [
                marked(results, name, condition),
                "all planes" if stacked else "one plane",
                *map(score.estimate, estimates),
                score.number(float(np.mean(values))),
                number(seconds),
                number(seconds * (1 if stacked else len(distances))),
            ]
        )
    return table([*columns, "seconds a hologram", "seconds a scene"], rows)


def _at(results: Results, values: Array, plane: float) -> Estimate:
    """Mean of those of ``(targets,)`` values that belong to a plane, a value per scene."""
    return mean_interval(values[[results.layout.planes[target][1] == plane for target in results.targets]])


SECTIONS = (Section("focus", 70, _render, applies=lambda report: bool(report.layout.planes), details=True),)
