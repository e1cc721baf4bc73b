"""A family of displays: which of them come near published figures, and what methods gain on those that do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from ...study.calibration.family import Range, Row
from .look.medium import medium
from .look.methods import Look
from .style import PALE, grid, laid_out, legend_below, new_figure, save, style

SIDE, FRAME = 150, 90  # pixels: of a panel, around all
BINS = 12
FIT = "#1F4E8C"


def draw_corner(path: Path, parameters: Sequence[Range], rows: Sequence[Row], fit: Sequence[Row]) -> None:
    """Draw each pair of some parameters, all draws pale, those that fit dark; on the diagonal how the latter lie."""
    count = len(parameters)
    size = round(medium().scale * (SIDE * count + FRAME))
    with style():
        figure = new_figure(size, size)
        figure.set_layout_engine("constrained", w_pad=0.03, h_pad=0.03)
        axes = figure.subplots(count, count, squeeze=False)
        for down, vertical in enumerate(parameters):
            for across, horizontal in enumerate(parameters):
                panel = axes[down, across]
                if across > down:
                    panel.set_axis_off()
                    continue
                panel.set_xlim(horizontal.low, horizontal.high)
                kept = [row[horizontal.name] for row in fit]
                if across == down:
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
        save(figure, path)


def _named(given: Range) -> str:
    words = medium().wrap(given.words, SIDE)
    return f"{words}\n[{given.unit}]" if given.unit else words


def draw_map(path: Path, shares: pd.DataFrame, margins: pd.DataFrame, axis: str, looked: Mapping[str, Look]) -> None:
    """Draw the margins of some methods against each share of an error [%], a mark a display, with a line for the eye.

    shares, margins: a row a display, a column a share or a method; axis: name of the margins; looked: the look of the
    methods that are drawn, by label.
    """
    with style():
        width, across = medium().width, 1 if medium().narrow else 2
        height = round(width * (1.9 if medium().narrow else 0.55))
        figure, panels = laid_out(width, height, 2 // across, across, sharey=True)
        for axes, (name, share) in zip(panels.flat, shares.items(), strict=True):
            for label, look in looked.items():
                values = margins[label]
                given = {"marker": look.marker, "color": look.face, "edgecolor": look.colour}
                axes.scatter(share, values, s=30 * medium().scale ** 2, label=label, **given)
                ends = np.array([share.min(), share.max()])
                axes.plot(ends, np.polyval(np.polyfit(share, values, 1), ends), color=look.colour, linewidth=1)
            axes.axhline(0, color="black", linewidth=1)
            axes.set_xlabel(medium().wrap(f"error explained by {name} [%]", 0.84 * width / across), parse_math=False)
            grid(axes)
        panels[0, 0].set_ylabel(medium().wrap(axis, 0.4 * width), parse_math=False)
        legend_below(figure, *panels[0, 0].get_legend_handles_labels())
        save(figure, path)
