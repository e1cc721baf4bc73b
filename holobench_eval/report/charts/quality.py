"""The headline metric of every method: a dot a target, the mean with its interval, the floor as a line."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from ..data.phrases import floor_scores
from ..data.results import Results
from ..data.statistics import Array, Estimate
from .look.medium import medium
from .look.methods import Look, looks
from .style import GREY, grid, save, stacked, style

ROW, LINE, FRAME = 27, 16, 62  # pixels: of a method, of a line of text, of a panel's title and axis
SPREAD = 0.3  # of a row to either side of its middle: targets keep their place in it from row to row
DOT, FEW = 9, 12  # size of a target's dot [square points], twice that for so few targets
NAMES = 0.28  # of the width, for the names of the methods
DASHES = ("--", ":", "-.")  # of floors, in their order


@dataclass(frozen=True)
class Row:
    """A method: its name with marks, its ``(targets,)`` values (NaN: none), their mean, and what is written beside."""

    name: str
    values: Array
    estimate: Estimate
    look: Look
    words: str


def draw_rows_of_dots(axes: Axes, rows: Sequence[Row]) -> None:
    """Draw rows from above to below, with their names to the left and their numbers to the right of the axes."""
    for height, row in enumerate(rows):
        offsets = np.linspace(-SPREAD, SPREAD, max(2, len(row.values)))[: len(row.values)]
        size = DOT if len(row.values) > FEW else 2 * DOT
        axes.scatter(row.values, height + offsets, s=size, color=row.look.colour, alpha=0.4, linewidth=0, zorder=2)
        mean, low, high = row.estimate.mean, row.estimate.low, row.estimate.high
        reach = np.nan_to_num([[mean - low], [high - mean]])
        axes.errorbar(mean, height, xerr=reach, fmt="none", ecolor="black", elinewidth=1.3, capsize=3, zorder=4)
        axes.plot(
            mean,
            height,
            marker=row.look.marker,
            markersize=7 * medium().scale ** 2,
            color=row.look.face,
            markeredgecolor=row.look.colour,
            markeredgewidth=1,
            zorder=5,
        )
        axes.annotate(
            row.words,
            (1, height),
            (6, 0),
            xycoords=axes.get_yaxis_transform(),
            textcoords="offset points",
            va="center",
            fontsize=medium().note,
            annotation_clip=False,
        )
    names = [medium().wrap(row.name, NAMES * medium().width) for row in rows]
    axes.set_yticks(range(len(rows)), names, parse_math=False, fontsize=medium().note)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    grid(axes, "x")


def height_of(rows: Sequence[Row]) -> int:
    """Of a panel [pixels of the screen]: all rows are as high as the one whose name has most lines."""
    lines = max(medium().wrap(row.name, NAMES * medium().width).count("\n") + 1 for row in rows)
    return FRAME + len(rows) * max(ROW, LINE * lines)


def footer_of(axis: str, labels: Sequence[str]) -> int:
    """Of the lines below the panels [pixels of the screen]: those of the axis, and those of the legend."""
    return LINE * (axis.count("\n") + sum(label.count("\n") + 1 for label in labels) + 1)


def best_first(rows: Iterable[Row], higher: bool) -> list[Row]:
    """Rows by their means."""
    return sorted(rows, key=lambda row: row.estimate.mean, reverse=higher)


def draw_quality(path: Path, results: Results, floors: Sequence[str]) -> None:
    """Draw a panel per display, best method first; UserError where no record has the headline.

    floors: rows of the floor, each a line.
    """
    score, panels = results.headline, {}
    for condition in results.conditions:
        if rows := best_first(_rows(results, condition), score.higher_is_better):
            panels[condition] = rows
    if not panels:
        return
    axis = f"{score.axis}{results.layout.text.axis}; dots: targets; mean with 95 % interval"
    axis = medium().wrap(axis, 0.6 * medium().width)
    labels = [
        medium().wrap(
            f"floor: {results.layout.text.floor_name(name)}, {floor_scores(results, name)}", 0.8 * medium().width
        )
        for name in floors
    ]
    with style():
        heights = [height_of(rows) for rows in panels.values()]
        figure, drawn = stacked(list(panels), heights, footer_of(axis, labels))
        for axes, (condition, rows) in zip(drawn, panels.items(), strict=True):
            draw_rows_of_dots(axes, rows)
            for name, label, dashes in zip(floors, labels, DASHES, strict=False):
                value = float(results.row(name, results.reference(condition))[score.column])
                axes.axvline(value, color=GREY, linestyle=dashes, linewidth=1.1, zorder=1, label=label)
        drawn[-1].set_xlabel(axis)
        if floors:
            figure.legend(*drawn[0].get_legend_handles_labels(), loc="outside lower center", frameon=False)
        save(figure, path)


def _rows(results: Results, condition: str) -> Iterable[Row]:
    """A row for every method with a score."""
    score, looked = results.headline, looks(results.names)
    for label in results.methods(condition):
        values = results.values(label, condition)
        estimate = results.estimate(values)
        if estimate.n:
            name = results.layout.marked(label)
            yield Row(name, values, estimate, looked[label], score.estimate(estimate))
