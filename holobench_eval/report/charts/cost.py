"""Quality against the photographs that it cost: a mark a row, a curve for each method with several budgets."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter

from ..data.board import Display, Row
from ..data.categories import ORACLE
from .look.medium import medium
from .look.methods import Look
from .style import grid, marks, save, stacked, style, without_math

TICKS = (0, 5, *(step * 10**power for power in range(1, 7) for step in (1, 2, 5)))
PANEL, LINE, FOOTER = 320, 17, 10  # pixels of the screen: of a panel, of a name beside it


def draw_costs(
    path: Path, displays: Sequence[Display], names: Mapping[str, str], looked: Mapping[str, Look], quality: str
) -> None:
    """Draw a panel a display.

    names: the registered name of every label, whose rows are joined; looked: by label; quality: the headline with its
    unit.
    """
    with style():
        rows = [_rows(display) for display in displays]
        heights = [max(PANEL, LINE * len(each) + 60) for each in rows]
        figure, drawn = stacked([display.name for display in displays], heights, FOOTER)
        for axes, each in zip(drawn, rows, strict=True):
            _draw(axes, each, names, looked)
            axes.set_ylabel(quality.replace(", of ", "\nof "))
        axes.set_xlabel("photographs in total, of training and of all targets")
        save(figure, path)


def _rows(display: Display) -> list[Row]:
    """Those with every target and a known number of photographs, without oracles."""
    rows = [row for group, rows in display.groups for row in rows if group != ORACLE]
    return [row for row in rows if row.photographs is not None and math.isfinite(row.score.mean) and row.scored]


def _draw(axes: Axes, rows: Sequence[Row], names: Mapping[str, str], looked: Mapping[str, Look]) -> None:
    """Curves and marks; bars are the intervals of the differences to the baseline, moved to the means."""
    for method in dict.fromkeys(names[row.label] for row in rows):
        own = sorted((row for row in rows if names[row.label] == method), key=lambda row: row.photographs or 0.0)
        if len({row.photographs for row in own}) == len(own) > 1:
            points = [(row.photographs, row.score.mean) for row in own]
            axes.plot(*zip(*points, strict=True), color=looked[own[0].label].colour, linewidth=1.4, zorder=2)
        for row in own:
            look, test = looked[row.label], row.test
            half = (test.estimate.high - test.estimate.low) / 2 if test else math.nan
            axes.errorbar(
                row.photographs or 0.0,
                row.score.mean,
                yerr=half if math.isfinite(half) else None,
                **marks(look, 6.5),
                linestyle="none",
                ecolor=look.colour,
                capsize=2.5,
                label=row.label,
                zorder=3,
            )
    axes.set_xscale("symlog", linthresh=10)
    most = max(row.photographs or 0.0 for row in rows)
    axes.set_xticks([tick for tick in TICKS if tick <= most] or [0])
    axes.set_xlim(right=1.4 * most)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}"))
    grid(axes)
    legend(axes)


def legend(axes: Axes) -> None:
    """The names of what is drawn, in rows to the right of the panel."""
    without_math(axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False, fontsize=medium().note))
