"""Rows of dots: a dot a target, the mean with its interval."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from ..data.statistics import Array, Estimate
from .look.medium import medium
from .look.methods import Look
from .style import grid

ROW, LINE, FRAME = 27, 16, 62  # pixels: of a method, of a line of text, of a panel's title and axis
SPREAD = 0.3  # of a row to either side of its middle: targets keep their place in it from row to row
DOT, FEW = 9, 12  # size of a target's dot [square points], twice that for so few targets
NAMES = 0.28  # of the width, for the names of the methods


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
