"""Places of the methods over draws of a display, and how far each draw's ranking is from the nominal one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator

from ..statistics import Array, Estimate
from ..text import bracketed
from .look import GREY, PALE, chart, grid, medium

ROW, FRAME, AGREEMENT = 34, 125, 240  # pixels: of a method, around all, and of what stands below
NAMES = 0.27  # of the width, for the names of the methods
NARROWEST = 0.05  # of a bar on the axis of Kendall's tau
SHADES = LinearSegmentedColormap.from_list("shares", [(0.0, "white"), (1.0, "#222222")])
DARK = 0.55  # share from which on figures in a cell are white


def draw_ranks(path: Path, title: str, ranks: pd.DataFrame, taus: Array, mean: Estimate) -> None:
    """Draw the places of the methods and the agreement of the draws side by side.

    ranks: a column a method, the nominal places first, then those in each draw; taus: Kendall's tau-b of the draws
    against the nominal places, and their mean.
    """
    narrow, height = medium().narrow, FRAME + ROW * max(4, len(ranks.columns))
    shape: dict[str, Any] = {"columns": 2, "width_ratios": [5, 3]}
    if narrow:
        shape = {"rows": 2, "height_ratios": [height, AGREEMENT]}
    with chart(path, height + AGREEMENT * narrow, **shape) as (figure, panels):
        figure.set_layout_engine("constrained", w_pad=0.08)
        look = {"x": 0.01, "ha": "left", "weight": "bold", "fontsize": medium().text + 1, "parse_math": False}
        figure.suptitle(title, **look)
        _shares(panels.flat[0], ranks)
        _agreement(panels.flat[1], len(ranks.columns), taus, mean)


def _shares(axes: Axes, ranks: pd.DataFrame) -> None:
    count = len(ranks.columns)
    shares = np.stack([(ranks[1:] == rank).mean() for rank in range(1, count + 1)], axis=1)
    axes.imshow(shares, cmap=SHADES, vmin=0, vmax=1, aspect="auto")
    for row, column in zip(*np.nonzero(shares), strict=True):
        percent = 100 * shares[row, column]
        colour = "white" if shares[row, column] > DARK else "black"
        axes.text(column, row, f"{percent:.0f}" if percent >= 1 else "<1", ha="center", va="center", color=colour)
    for row, position in enumerate(ranks.iloc[0]):
        axes.add_patch(
            Rectangle((position - 1.5, row - 0.5), 1, 1, fill=False, edgecolor="black", linewidth=1.5, zorder=3)
        )
    names = [medium().wrap(str(label), NAMES * medium().width) for label in ranks]
    axes.set_yticks(range(count), names, parse_math=False, fontsize=medium().note)
    axes.set_xticks(range(count), [str(rank) for rank in range(1, count + 1)])
    axes.set_xticks(np.arange(count + 1) - 0.5, minor=True)
    axes.set_yticks(np.arange(count + 1) - 0.5, minor=True)
    axes.grid(which="minor", color="#E5E5E5", linewidth=0.6)
    axes.tick_params(which="both", length=0)
    axes.spines[:].set_visible(False)
    axes.set_xlabel("rank in a draw")
    axes.set_title(f"ranks: share of {len(ranks) - 1} draws [%]", loc="left")


def _agreement(axes: Axes, methods: int, taus: Array, mean: Estimate) -> None:
    step = max(NARROWEST, 4 / (methods * (methods - 1)))
    steps, draws = np.unique(((1 - taus) / step).round(), return_counts=True)
    axes.bar(1 - step * steps, draws, width=min(0.8 * step, 0.1), color=PALE)
    top = 1.22 * draws.max()
    axes.errorbar(
        [mean.mean], [0.93 * top], xerr=mean.reach, fmt="o", color=GREY, markersize=5, capsize=3, elinewidth=1.2
    )
    axes.set_title(f"mean tau {bracketed(mean, '.2f')}", loc="left")
    axes.axvline(0, color="black", linewidth=0.8, linestyle="--")
    axes.set_xlim(min(0.0, taus.min()) - 0.08, 1.08)
    axes.set_ylim(0, top)
    axes.yaxis.set_major_locator(MaxNLocator(5, integer=True))
    axes.set_ylabel("draws")
    axes.set_xlabel("Kendall's tau-b against\nthe nominal ranking")
    grid(axes, "y")
