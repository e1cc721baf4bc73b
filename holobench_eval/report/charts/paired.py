"""Differences to the baseline: a dot a target or a display, the mean with its interval, a line at zero."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from ..results import Results
from ..scores import Score
from ..statistics import Array, Estimate
from .look.medium import medium
from .look.methods import Look, looks
from .style import GREY, grid, legend_below, marks, note, save, slugs, stacked, style

ROW, LINE, FRAME = 27, 16, 62  # pixels: of a method, of a line of text, of a panel's title and axis
SPREAD = 0.3  # of a row to either side of its middle: targets keep their place in it from row to row
DOT, FEW = 9, 12  # size of a target's dot [square points], twice that for so few targets
NAMES = 0.28  # of the width, for the names of the methods


@dataclass(frozen=True)
class Row:
    """A method: its name with marks, its ``(targets,)`` values (NaN: none), and their mean."""

    name: str
    values: Array
    estimate: Estimate
    look: Look


def displays(results: Results) -> list[tuple[str, str]]:
    """The displays that have a difference to draw, each with a name for its file."""
    slugged = slugs(results.conditions).items()
    return [(condition, stem) for condition, stem in slugged if any(_rows(results, condition))]


def draw(results: Results, condition: str, path: Path) -> str:
    """Draw the differences on one of ``displays``, best method first; the caption.

    Intervals are those of the paired tests, over clusters of targets (``data.statistics``). The dashed line is the
    constant image, at its mean difference to the baseline.
    """
    baseline, score = results.baseline, results.headline
    assert baseline is not None
    floor = results.floor(condition, less=results.values(baseline, condition))
    lines = {} if floor is None else {"floor: a constant image": floor}
    rows = sorted(_rows(results, condition), key=lambda row: row.estimate.mean, reverse=score.higher_is_better)
    draw_rows(results, path, condition, rows, lines)
    return (
        f"{results.headline.axis}{results.text.axis}, on {condition}: differences to the baseline "
        f"{results.baseline}. Small dots: targets, at the same height in every row; marks and bars: means and "
        "their 95 % intervals over clusters of targets, not adjusted for the number of comparisons."
    )


def draw_rows(results: Results, path: Path, title: str, rows: Sequence[Row], lines: Mapping[str, float]) -> None:
    """Draw rows of differences to the baseline, which is a line at zero; further lines are dashed."""
    baseline, score = results.baseline, results.headline
    better = "right" if score.higher_is_better else "left"
    axis = f"difference to {baseline} in {score.axis}{results.text.axis}; better: to the {better}"
    axis = medium().wrap(axis, 0.6 * medium().width)
    labels = [f"baseline: {baseline}"]
    labels += [f"{label}, {score.with_unit(value, signed=True)}" for label, value in lines.items()]
    labels = [medium().wrap(label, 0.8 * medium().width) for label in labels]
    names = [medium().wrap(row.name, NAMES * medium().width) for row in rows]
    height = FRAME + len(rows) * max(ROW, LINE * max(name.count("\n") + 1 for name in names))  # all are as high
    footer = LINE * (axis.count("\n") + sum(label.count("\n") + 1 for label in labels) + 1)
    with style():
        figure, (axes,) = stacked([title], [height], footer)
        _dots(axes, rows, names, score)
        axes.axvline(0, color="black", linewidth=1, zorder=1, label=labels[0])
        for value, label in zip(lines.values(), labels[1:], strict=True):
            axes.axvline(value, color=GREY, linewidth=1.1, linestyle="--", zorder=1, label=label)
        axes.set_xlabel(axis, parse_math=False)
        legend_below(figure, *axes.get_legend_handles_labels())
        save(figure, path)


def _rows(results: Results, condition: str) -> Iterator[Row]:
    """A row for every method but the baseline; how many targets have no difference stands in its name."""
    looked = looks(results.names)
    for test in results.tests.values() if results.baseline else ():
        if test.condition != condition or not test.estimate.n:
            continue
        name = results.facts.marked(test.second)
        if test.estimate.n < len(results.targets):
            name = f"{name}, {test.estimate.n} of {len(results.targets)} targets"
        yield Row(name, test.differences, test.estimate, looked[test.second])


def _dots(axes: Axes, rows: Sequence[Row], names: Sequence[str], score: Score) -> None:
    """Draw rows from above to below, with their names to the left and their numbers to the right of the axes."""
    for height, row in enumerate(rows):
        offsets = np.linspace(-SPREAD, SPREAD, max(2, len(row.values)))[: len(row.values)]
        size = DOT if len(row.values) > FEW else 2 * DOT
        axes.scatter(row.values, height + offsets, s=size, color=row.look.colour, alpha=0.4, linewidth=0, zorder=2)
        mean = row.estimate.mean
        axes.errorbar(
            mean, height, xerr=row.estimate.reach, fmt="none", ecolor="black", elinewidth=1.3, capsize=3, zorder=4
        )
        axes.plot(mean, height, **marks(row.look, 7), markeredgewidth=1, zorder=5)
        end = {"xytext": (6, 0), "xycoords": axes.get_yaxis_transform(), "annotation_clip": False}
        note(axes, score.estimate(row.estimate, signed=True), (1, height), **end)
    axes.set_yticks(range(len(rows)), names, parse_math=False, fontsize=medium().note)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    grid(axes, "x")
