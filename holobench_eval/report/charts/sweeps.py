"""Quality along a change of the display: a curve per method, or dots where the change has no axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from .cost import legend
from .look.medium import medium
from .look.methods import Look
from .style import GREY, grid, marks, save, stacked, style

PANEL, FOOTER = 330, 10


@dataclass(frozen=True)
class Curve:
    """A method along a sweep. mean: by point; reach: of each point's bar, down and up."""

    label: str
    mean: tuple[float, ...]
    reach: tuple[tuple[float, float], ...]
    look: Look
    dashed: bool = False


@dataclass(frozen=True)
class Panel:
    """A sweep on one display.

    positions: of the points on the axis; ticks: their names where they are no numbers (None: numbers); nominal: where
    nothing is changed, for a vertical line; floor: mean of a constant image, for a horizontal one.
    """

    title: str
    axis: str
    positions: tuple[float, ...]
    curves: tuple[Curve, ...]
    ticks: tuple[str, ...] | None = None
    nominal: float | None = None
    floor: float | None = None


def draw_sweep(path: Path, panels: Sequence[Panel], quality: str) -> None:
    """Draw a panel per display. quality: name of the headline metric with its unit."""
    with style():
        figure, drawn = stacked([panel.title for panel in panels], [PANEL] * len(panels), FOOTER)
        for axes, panel in zip(drawn, panels, strict=True):
            _draw_curves(axes, panel)
            axes.set_ylabel(quality.replace(", of ", "\nof "))
        save(figure, path)


def _draw_curves(axes: Axes, panel: Panel) -> None:
    """The curves, and their names in rows to the right."""
    spread = np.ptp(panel.positions) / 250 if len(panel.positions) > 1 else 0.0
    for index, curve in enumerate(panel.curves):
        positions = np.array(panel.positions) + (index - (len(panel.curves) - 1) / 2) * (
            spread if panel.ticks is None else 0.07
        )
        axes.errorbar(
            positions,
            curve.mean,
            yerr=np.nan_to_num(np.array(curve.reach).T),
            color=curve.look.colour,
            **marks(curve.look, 6.5),
            linewidth=1.5 if panel.ticks is None else 0,
            linestyle="--" if curve.dashed else "-",
            elinewidth=0.8,
            capsize=2,
            label=curve.label,
        )
    if panel.floor is not None:
        axes.axhline(panel.floor, color=GREY, linewidth=1.1, linestyle=(0, (3, 3)), zorder=1, label="a gray picture")
    if panel.nominal is not None:
        axes.axvline(panel.nominal, color="black", linewidth=0.8, linestyle=":")
    if panel.ticks is not None:
        axes.set_xticks(panel.positions, panel.ticks, parse_math=False)
    axes.set_xlabel(medium().wrap(panel.axis, 0.6 * medium().width))
    axes.margins(x=0.03)
    grid(axes)
    legend(axes)
