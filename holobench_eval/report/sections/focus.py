"""Focal stacks, plane by plane: what is in focus there, and what one hologram of all planes costs and gains."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup

from ..data.results import Results
from ..data.scores import Score
from ..data.statistics import Array, bootstrap_mean
from ..data.text import words
from ..markdown import escape, table
from .tables import label, number


def planes(results: Results) -> list[float]:
    """The planes [mm], nearest to the panel first."""
    return sorted({plane for _, plane in results.layout.planes.values()})


def scenes(results: Results) -> int:
    """How many scenes there are."""
    return len({scene for scene, _ in results.layout.planes.values()})


def by_plane(results: Results, condition: str) -> Markup:
    """Mean over scenes at every plane, and seconds; empty for a study without planes or scores."""
    if not results.layout.planes:
        return Markup("")
    score, every = results.headline, planes(results)
    columns = ["method", "hologram of", *(f"{plane:g} mm" for plane in every), "all planes"]
    rows = []
    for name in results.methods(condition):
        values, whole = results.values(name, condition), name in results.layout.stacked
        estimates = [bootstrap_mean(_at(results, values, plane)) for plane in every]
        seconds = float(results.row(name, condition)["seconds"])
        rows.append(
            [
                label(results, name),
                "all planes" if whole else "one plane",
                *(score.interval(one.mean, one.low, one.high) for one in estimates),
                score.number(float(np.mean(values))),
                number(seconds),
                number(seconds * (1 if whole else len(every))),
            ]
        )
    return table([*columns, "seconds a hologram", "seconds a scene"], rows)


def sentences(results: Results, condition: str) -> list[Markup]:
    """What one hologram of all planes costs and gains against the baseline's, moved from plane to plane by a lens."""
    baseline, names = results.layout.baseline, results.methods(condition)
    wanted = [name for name in names if name in results.layout.stacked]
    if baseline not in names or baseline in results.layout.stacked:
        return []
    told = [_compared(results, condition, str(baseline), name) for name in wanted]
    return [escape(sentence) for sentence in told if sentence]


def _compared(results: Results, condition: str, baseline: str, name: str) -> str:
    score, every = results.headline, planes(results)
    first, second = (results.values(one, condition) for one in (baseline, name))
    if not np.isfinite(second - first).all():
        return ""
    seconds, other = (float(results.row(one, condition)["seconds"]) for one in (name, baseline))
    estimate = bootstrap_mean(second - first)
    difference = score.interval(estimate.mean, estimate.low, estimate.high, signed=True)
    unit = f" {score.unit}" if score.unit else ""
    where = " in focus" if score.in_focus else ""
    return (
        f"{name} makes one hologram of all {len(every)} planes and need not know where the eye looks. It takes "
        f"{number(seconds)} s, {number(seconds / other)} times what {baseline} takes for one plane and "
        f"{number(seconds / other / len(every))} times what {baseline} takes for all of them. Against {baseline} moved "
        f"by a lens it {_turned(score, estimate.mean)}{where}: {difference}{unit} over all planes; "
        f"{_each(results, second - first)}."
    )


def _turned(score: Score, difference: float) -> str:
    return "gains" if score.better(difference, 0.0) else "loses"


def _each(results: Results, difference: Array) -> str:
    """The mean difference at every plane."""
    score = results.headline
    means = {plane: float(_at(results, difference, plane).mean()) for plane in planes(results)}
    return words([f"{score.with_unit(mean, signed=True)} at {plane:g} mm" for plane, mean in means.items()])


def _at(results: Results, values: Array, plane: float) -> Array:
    """Those of ``(targets,)`` values that belong to a plane, a value per scene."""
    return values[[results.layout.planes[target][1] == plane for target in results.targets]]
