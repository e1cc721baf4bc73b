"""Quality as curves: against the photographs that it cost, along a change of the display, and while a method trains."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, MaxNLocator

from ...display.simulated.changes import KINDS
from ...study.artifacts import Round
from ..board import Display, Row
from ..facts import ORACLE
from ..results import Results
from .look import GREY, SHADES, Look, chart, grid, legend_below, legend_beside, looks, medium, stacked

TICKS = (0, 5, *(step * 10**power for power in range(1, 7) for step in (1, 2, 5)))
COSTS, SWEEP, LINE, FOOTER = 320, 330, 17, 10  # pixels of the screen: of a panel of either, of a name beside it
Rounds = tuple[str, tuple[Round, ...]]  # a training's name and its rounds

COLUMNS, A_PAGE, NARROWEST = 3, 6, 200  # of trainings: panels side by side and on a page, pixels of a panel
MOST = 12  # trainings with a panel each; of more, the table alone is in the report
LINES = (
    ("predicted", "predicted picture, against the target", SHADES[0], "o"),
    ("captured", "captured picture, against the target", SHADES[1], "s"),
    ("fidelity", "prediction, against the capture (fidelity)", SHADES[2], "^"),
)


def draw_costs(
    path: Path, displays: Sequence[Display], names: Mapping[str, str], looked: Mapping[str, Look], quality: str
) -> None:
    """Draw quality against photographs, a panel a display: a mark a row, a curve a method with several budgets.

    names: the registered name of every label, whose rows are joined; looked: by label; quality: the headline with its
    unit.
    """
    rows = [_rows(display) for display in displays]
    heights = [max(COSTS, LINE * len(each) + 60) for each in rows]
    label = "photographs in total, of training and of all targets"
    panels = stacked(path, [display.name for display in displays], heights, FOOTER, label)
    for axes, each in zip(panels, rows, strict=True):
        _draw_costs(axes, each, names, looked)
        _finish(axes, quality)


def draw_sweep(path: Path, results: Results, points: pd.DataFrame, quality: str) -> None:
    """Draw a change of displays, a panel a display: a curve a method, or dots where the change has no axis.

    points: of one kind, with their display, method, value and its text, condition and loss.
    """
    displays = {str(name): each for name, each in points.groupby("display", sort=False)}
    panels = stacked(path, list(displays), [SWEEP] * len(displays), FOOTER)
    for axes, each in zip(panels, displays.values(), strict=True):
        _draw_sweep(axes, results, each)
        _finish(axes, quality)


def _finish(axes: Axes, quality: str) -> None:
    """The names of what is drawn, and of the axis."""
    axes.set_ylabel(quality.replace(", of ", "\nof "))
    grid(axes)
    legend_beside(axes)


def _rows(display: Display) -> list[Row]:
    """Those with every target and a known number of photographs, without oracles."""
    rows = [row for row in display.rows if row.category != ORACLE]
    return [row for row in rows if row.photographs is not None and math.isfinite(row.score.mean) and row.scored]


def _draw_costs(axes: Axes, rows: Sequence[Row], names: Mapping[str, str], looked: Mapping[str, Look]) -> None:
    """Curves and marks; bars are the intervals of the differences to the baseline, moved to the means."""
    for method in dict.fromkeys(names[row.label] for row in rows):
        own = sorted((row for row in rows if names[row.label] == method), key=lambda row: row.photographs or 0.0)
        if len({row.photographs for row in own}) == len(own) > 1:
            points = [(row.photographs, row.score.mean) for row in own]
            axes.plot(*zip(*points, strict=True), color=looked[own[0].label].colour, linewidth=1.4, zorder=2)
        for row in own:
            look, known = looked[row.label], row.test and math.isfinite(row.test.estimate.low)
            axes.errorbar(
                row.photographs or 0.0,
                row.score.mean,
                yerr=row.test.estimate.reach if row.test and known else None,
                **look.marks(6.5),
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


def _draw_sweep(axes: Axes, results: Results, points: pd.DataFrame) -> None:
    """Means, slightly apart from each other, with bars for their differences to the unchanged display."""
    kind = KINDS[points["kind"].iloc[0]]
    curves = {str(label): curve for label, curve in points.groupby("method", sort=False)}
    places = points.drop_duplicates("text")
    looked, better = looks(results.names), results.headline.sign
    positions = places["value"].to_numpy(np.float64) if kind.numeric else np.arange(len(places))
    apart = np.ptp(positions) / 250 if kind.numeric else 0.07
    for index, (label, curve) in enumerate(curves.items()):
        axes.errorbar(
            positions + (index - (len(curves) - 1) / 2) * apart,
            [results.values(label, str(name)).mean() for name in curve["condition"]],
            yerr=np.hstack([loss.reach[::-better] if loss else np.zeros((2, 1)) for loss in curve["loss"]]),
            color=looked[label].colour,
            **looked[label].marks(6.5),
            linewidth=1.5 if kind.numeric else 0,
            linestyle="--" if label == results.baseline else "-",
            elinewidth=0.8,
            capsize=2,
            label=label,
        )
    if (floor := results.floor(points["display"].iloc[0])) is not None:
        axes.axhline(floor, color=GREY, linewidth=1.1, linestyle=(0, (3, 3)), zorder=1, label="a gray picture")
    if kind.nominal is not None:
        axes.axvline(kind.nominal, color="black", linewidth=0.8, linestyle=":")
    if not kind.numeric:
        axes.set_xticks(positions, list(places["text"]), parse_math=False)
    axes.set_xlabel(medium().wrap(f"{kind.words}{f' [{kind.unit}]' if kind.unit else ''}", 0.6 * medium().width))
    axes.margins(x=0.03)


def draw_trainings(stem: Path, trainings: Sequence[Rounds]) -> list[Path]:
    """Draw the trainings that have several rounds, where they are few enough to be looked at; the files.

    stem: the files' name without number and ending. All panels have one range, so that they can be compared by eye.
    """
    drawable = [(name, kept) for name, rounds in trainings if (kept := tuple(filter(_has_figures, rounds)))]
    if len(drawable) > MOST or all(len(rounds) == 1 for _, rounds in drawable):
        return []
    steps = [step for _, rounds in drawable for step in rounds]
    values = np.array([getattr(step, name) for step in steps for name, *_ in LINES])
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    margin = max(0.5, 0.08 * (high - low))
    limits = {
        "xlim": (0.0, max(step.captures for step in steps) * 1.06 + 0.5),
        "ylim": (low - margin, high + margin),
    }
    pages = range(0, len(drawable), A_PAGE)
    drawn = [stem.with_name(f"{stem.name}-{number}.png") for number in range(1, len(pages) + 1)]
    for path, start in zip(drawn, pages, strict=True):
        _draw_page(path, drawable[start : start + A_PAGE], limits)
    return drawn


def _has_figures(step: Round) -> bool:
    return math.isfinite(step.captures) and any(math.isfinite(getattr(step, name)) for name, *_ in LINES)


def _draw_page(path: Path, trainings: Sequence[Rounds], limits: Mapping[str, tuple[float, float]]) -> None:
    """A panel per training: the three figures against the captures taken, a mark per round."""
    columns = min(COLUMNS, len(trainings), medium().width // NARROWEST)
    rows = -(-len(trainings) // columns)
    letters = medium().characters(0.85 * medium().width / columns)
    with chart(path, 60 + 270 * rows, rows, columns, sharey=True) as (figure, panels):
        for axes in panels.flat[len(trainings) :]:
            axes.remove()
        for axes, (name, steps) in zip(panels.flat, trainings, strict=False):
            captures = [step.captures for step in steps]
            for key, label, colour, marker in LINES:
                axes.plot(captures, [getattr(step, key) for step in steps], color=colour, marker=marker, label=label)
            axes.set(xlabel="captures taken for training", **limits)
            axes.xaxis.set_major_locator(MaxNLocator(5, integer=True))
            grid(axes)
            title = textwrap.fill(name, letters, max_lines=2, placeholder="...", break_on_hyphens=False)
            axes.set_title(title, loc="left", weight="bold", parse_math=False)
        for axes in panels[:, 0]:
            axes.set_ylabel(medium().wrap("PSNR on held-out images [dB]", 75 * figure.get_figheight() / rows))
        legend_below(figure, *panels[0, 0].get_legend_handles_labels())
