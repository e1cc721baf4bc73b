"""A family of displays: what methods gain on them, and what a lab can measure that tells it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from .look.medium import medium
from .look.methods import Look
from .style import grid, laid_out, legend_below, save, style


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
