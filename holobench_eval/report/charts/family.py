"""A family of displays: which of them come near published figures, and what methods gain on those that do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from ...study.calibration.family import Range, Row
from .look import PALE, Look, chart, grid, legend_below, medium

SIDE, FRAME = 150, 90  # pixels: of a panel, around all
BINS = 12
FIT = "#1F4E8C"


def draw_corner(path: Path, parameters: Sequence[Range], rows: Sequence[Row], fit: Sequence[Row]) -> None:
    """Draw each pair of some parameters, all draws pale, those that fit dark; on the diagonal how the latter lie."""
    count, size = len(parameters), SIDE * len(parameters) + FRAME
    with chart(path, size, count, count, size) as (figure, panels):
        figure.set_layout_engine("constrained", w_pad=0.03, h_pad=0.03)
        for (down, across), panel in np.ndenumerate(panels):
            vertical, horizontal = parameters[down], parameters[across]
            if across > down:
                panel.set_axis_off()
                continue
            panel.set_xlim(horizontal.low, horizontal.high)
            if across == down:
                kept = [row[horizontal.name] for row in fit]
                panel.hist(kept, bins=BINS, range=(horizontal.low, horizontal.high), color=FIT)
                panel.axhline(len(kept) / BINS, color="black", linewidth=0.8, linestyle=":")
            else:
                panel.set_ylim(vertical.low, vertical.high)
                for some, colour, area in ((rows, PALE, 2), (fit, FIT, 6)):
                    places = [[row[each.name] for row in some] for each in (horizontal, vertical)]
                    panel.scatter(*places, s=area, color=colour, linewidths=0)
            label = {"fontsize": medium().note, "parse_math": False}
            panel.set_xlabel(_named(horizontal), **label)
            panel.set_ylabel(_named(vertical) if down else "", **label)
            panel.tick_params(labelsize=medium().note)
            panel.label_outer()


def _named(given: Range) -> str:
    words = medium().wrap(given.words, SIDE)
    return f"{words}\n[{given.unit}]" if given.unit else words


def draw_map(path: Path, shares: pd.DataFrame, margins: pd.DataFrame, axis: str, looked: Mapping[str, Look]) -> None:
    """Draw the margins of some methods against each share of an error [%], a mark a display, with a line for the eye.

    shares, margins: a row a display, a column a share or a method; axis: name of the margins; looked: the look of the
    methods that are drawn, by label.
    """
    narrow, width = medium().narrow, medium().width
    shape = {"rows": 2} if narrow else {"columns": 2}
    with chart(path, 495 * (1 + narrow), sharey=True, **shape) as (figure, panels):
        for axes, (name, share) in zip(panels.flat, shares.items(), strict=True):
            ends = np.array([share.min(), share.max()])
            for label, look in looked.items():
                values = margins[label]
                given = {"marker": look.marker, "color": look.face, "edgecolor": look.colour}
                axes.scatter(share, values, s=30 * medium().scale, label=label, **given)
                axes.plot(ends, np.polyval(np.polyfit(share, values, 1), ends), color=look.colour, linewidth=1)
            axes.axhline(0, color="black", linewidth=1)
            words = medium().wrap(f"error explained by {name} [%]", 0.84 * width / (2 - narrow))
            axes.set_xlabel(words, parse_math=False)
            grid(axes)
        panels[0, 0].set_ylabel(medium().wrap(axis, 0.4 * width), parse_math=False)
        legend_below(figure, *panels[0, 0].get_legend_handles_labels())
