"""Focal stacks, plane by plane: what is in focus there, and what one hologram of all planes costs and gains."""

from __future__ import annotations

import numpy as np

from ..data.phrases import marked
from ..data.results import Results
from ..data.statistics import Array, Estimate, mean_interval
from ..data.text import number, words
from ..markdown import Markdown, bullets, heading, table
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
        yield bullets(sentences(report.results, condition))


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


def sentences(results: Results, condition: str) -> list[str]:
    """What one hologram of all planes costs and gains against the baseline's, moved from plane to plane by a lens."""
    baseline, names = results.layout.baseline, results.methods(condition)
    if baseline not in names or baseline in results.layout.stacked:
        return []
    stacked = [name for name in names if name in results.layout.stacked]
    return [sentence for name in stacked if (sentence := _compared(results, condition, str(baseline), name))]


def _compared(results: Results, condition: str, baseline: str, name: str) -> str:
    score, count = results.headline, len(planes(results))
    gained = results.values(name, condition) - results.values(baseline, condition)
    if not np.isfinite(gained).all():
        return ""
    seconds, other = (float(results.row(label, condition)["solving_s"]) for label in (name, baseline))
    estimate = results.estimate(gained)
    difference = score.estimate(estimate, signed=True)
    unit = f" {score.unit}" if score.unit else ""
    where = " in focus" if score.in_focus else ""
    return (
        f"{name} makes one hologram of all {count} planes, whichever one the eye looks at. It takes "
        f"{number(seconds)} s: {number(seconds / other)} times the time of {baseline} for one plane, "
        f"{number(seconds / other / count)} times that for all planes. Compared with {baseline}, refocused by a lens, "
        f"it {'gains' if score.better(estimate.mean, 0.0) else 'loses'}{where}: {difference}{unit} over all "
        f"planes; {_each(results, gained)}."
    )


def _each(results: Results, difference: Array) -> str:
    """The mean difference at every plane."""
    score = results.headline
    means = {plane: _at(results, difference, plane).mean for plane in planes(results)}
    return words([f"{score.with_unit(mean, signed=True)} at {plane:g} mm" for plane, mean in means.items()])


def _at(results: Results, values: Array, plane: float) -> Estimate:
    """Mean of those of ``(targets,)`` values that belong to a plane, a value per scene."""
    return mean_interval(values[[results.layout.planes[target][1] == plane for target in results.targets]])


SECTIONS = (Section("focus", 70, _render, applies=lambda report: bool(report.layout.planes)),)
