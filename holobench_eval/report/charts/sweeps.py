"""Quality along a change of the display: a curve per method, or dots where the change has no axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from .style import COLOURS, GREY, grid, save, stacked, style

PANEL, FOOTER = 330, 60
MARKS = "osD^vP*X"


@dataclass(frozen=True)
class Curve:
    """A method along a sweep. mean: by point; reach: of each point's bar, down and up."""

    label: str
    mean: tuple[float, ...]
    reach: tuple[tuple[float, float], ...]
    dashed: bool = False


@dataclass(frozen=True)
class Panel:
    """A sweep on one display.

    positions: of the points on the axis; ticks: their names where they are no numbers (None: numbers); nominal: where
    nothing is changed, for a vertical line.
    """

    title: str
    axis: str
    positions: tuple[float, ...]
    curves: tuple[Curve, ...]
    ticks: tuple[str, ...] | None = None
    nominal: float | None = None


def draw_sweep(path: Path, panels: Sequence[Panel], quality: str) -> None:
    """Draw a panel per display. quality: name of the headline metric with its unit."""
    labels = list(dict.fromkeys(curve.label for panel in panels for curve in panel.curves))
    looks = {label: (COLOURS[i % len(COLOURS)], MARKS[i % len(MARKS)]) for i, label in enumerate(labels)}
    rows = -(-len(labels) // 4)
    with style():
        figure, drawn = stacked([panel.title for panel in panels], [PANEL] * len(panels), FOOTER + 16 * rows)
        legend: dict[str, Artist] = {}
        for axes, panel in zip(drawn, panels, strict=True):
            _draw_curves(axes, panel, looks)
            axes.set_ylabel(quality.replace(", of ", "\nof "))
            handles, names = axes.get_legend_handles_labels()
            legend |= dict(zip(names, handles, strict=True))
        figure.legend(list(legend.values()), list(legend), loc="outside lower center", ncols=4, frameon=False)
        save(figure, path)


def _draw_curves(axes: Axes, panel: Panel, looks: dict[str, tuple[str, str]]) -> None:
    spread = np.ptp(panel.positions) / 250 if len(panel.positions) > 1 else 0.0
    for index, curve in enumerate(panel.curves):
        colour, mark = looks[curve.label]
        positions = np.array(panel.positions) + (index - (len(panel.curves) - 1) / 2) * (
            spread if panel.ticks is None else 0.07
        )
        axes.errorbar(
            positions,
            curve.mean,
            yerr=np.nan_to_num(np.array(curve.reach).T),
            color=GREY if curve.dashed else colour,
            marker=mark,
            markersize=5,
            markeredgecolor="white",
            markeredgewidth=0.5,
            linewidth=1.5 if panel.ticks is None else 0,
            linestyle="--" if curve.dashed else "-",
            elinewidth=0.8,
            capsize=2,
            label=curve.label,
        )
    if panel.nominal is not None:
        axes.axvline(panel.nominal, color="black", linewidth=0.8, linestyle=":")
    if panel.ticks is not None:
        axes.set_xticks(panel.positions, panel.ticks, parse_math=False)
    axes.set_xlabel(panel.axis)
    grid(axes)
