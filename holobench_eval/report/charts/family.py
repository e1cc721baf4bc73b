"""A family of displays: what methods gain on them, and what a lab can measure that tells it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from .look import Look, chart, grid, legend_below, medium


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
