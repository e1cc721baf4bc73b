"""Charts of the headline metric: quality with intervals, and every target's value."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from numpy.typing import NDArray

from ..data.layout import Layout
from ..data.scores import Score
from .style import COLOURS, GREY, PALE, WIDTH, grid, save, stacked, style

METHOD_WIDTH = 115  # pixels that a method's name has below the per-target chart
LABELLED_TARGETS = 14  # lines of the per-target chart carry their target's name up to this many; more would overlap


@dataclass(frozen=True)
class Chart:
    """What all charts share.

    score: the headline metric; methods: labels in order; floors: what the floor scores, by its description.
    """

    score: Score
    layout: Layout
    methods: tuple[str, ...]
    floors: Mapping[str, float]

    @property
    def axis(self) -> str:
        """The metric's title, domain and unit, for an axis."""
        return f"{self.score.axis}{self.layout.text.axis}"

    def is_oracle(self, label: str) -> bool:
        """Whether a method may differentiate through the bench."""
        return label in self.layout.privileged

    def colour(self, label: str) -> str:
        """The method's colour, the same in every chart; oracles are grey."""
        competitors = [method for method in self.methods if not self.is_oracle(method)]
        return GREY if self.is_oracle(label) else COLOURS[competitors.index(label) % len(COLOURS)]


def _offsets(rows: pd.DataFrame, score: str) -> NDArray[np.float64]:
    """``(2, n)`` distances from the mean to its interval; zero where there is no interval."""
    mean, low, high = (rows[key].to_numpy(dtype=np.float64) for key in (score, f"{score}_lo", f"{score}_hi"))
    offsets: NDArray[np.float64] = np.nan_to_num(np.vstack([mean - low, high - mean]), nan=0.0)
    return offsets


def quality_bars(path: Path, table: pd.DataFrame, chart: Chart) -> None:
    """Mean of the headline metric with its interval, a panel per condition, floors as vertical lines."""
    score = chart.score.key
    rows = table[table["method"].isin(chart.methods) & np.isfinite(table[score])]
    conditions = list(dict.fromkeys(rows["condition"]))
    groups = {condition: rows[rows["condition"] == condition] for condition in conditions}
    with style():
        heights = [60 + 30 * len(groups[condition]) for condition in conditions]
        figure, panels = stacked(conditions, heights, footer=90)
        limit = float(np.nanmax(rows[[score, f"{score}_hi"]].to_numpy())) * 1.3
        for axes, condition in zip(panels, conditions, strict=True):
            _bars(axes, groups[condition], chart)
            for (_, value), dash in zip(chart.floors.items(), ("--", ":"), strict=False):
                axes.axvline(value, color="black", linestyle=dash, linewidth=1.2)
            axes.set_xlim(0, limit)
        panels[-1].set_xlabel(f"{chart.axis}; mean over targets, 95 % interval")
        for (name, value), dash in zip(chart.floors.items(), ("--", ":"), strict=False):
            panels[-1].plot(
                [], [], color="black", linestyle=dash, label=f"floor: {name}, {chart.score.with_unit(value)}"
            )
        if chart.floors:
            figure.legend(loc="outside lower center", ncols=2, frameon=False)
        save(figure, path)


def _bars(axes: Axes, rows: pd.DataFrame, chart: Chart) -> None:
    score = chart.score.key
    labels, heights = list(rows["method"]), np.arange(len(rows))
    offsets = _offsets(rows, score)
    bars = axes.barh(heights, rows[score], height=0.62, color=[chart.colour(label) for label in labels])
    for bar, label in zip(bars, labels, strict=True):
        if chart.is_oracle(label):
            bar.set(facecolor="white", edgecolor=GREY, hatch="////")
    axes.errorbar(rows[score], heights, xerr=offsets, fmt="none", ecolor="black", elinewidth=1.2, capsize=3)
    for height, (mean, low, high, end) in enumerate(
        zip(rows[score], rows[f"{score}_lo"], rows[f"{score}_hi"], rows[score] + offsets[1], strict=True)
    ):
        words = chart.score.interval(mean, low, high)
        axes.annotate(words, (end, height), (7, 0), textcoords="offset points", va="center", fontsize=8)
    axes.set_yticks(heights, [chart.layout.marked(label) for label in labels], parse_math=False)
    axes.invert_yaxis()
    axes.tick_params(axis="y", length=0)


def target_dots(path: Path, values: Mapping[str, pd.DataFrame], chart: Chart) -> None:
    """Every target's headline value, a line per target across the methods, so that the spread is seen.

    values: by condition, a frame with targets down and method labels across; NaN where there is no score.
    """
    with style():
        width = max(WIDTH, 150 + METHOD_WIDTH * max(frame.shape[1] for frame in values.values()))
        figure, panels = stacked(list(values), [340] * len(values), footer=20, width=width)
        for axes, frame in zip(panels, values.values(), strict=True):
            _dots(axes, frame, chart)
        save(figure, path)


def _dots(axes: Axes, frame: pd.DataFrame, chart: Chart) -> None:
    columns = np.arange(frame.shape[1])
    for _, row in frame.iterrows():
        axes.plot(columns, row.to_numpy(), color=PALE, linewidth=0.9, zorder=1)
    for column, label in zip(columns, frame.columns, strict=True):
        values = frame[label].dropna()
        face = "white" if chart.is_oracle(label) else chart.colour(label)
        axes.scatter(np.full(len(values), column), values, s=26, color=face, edgecolor=chart.colour(label), zorder=2)
        if len(values):
            axes.hlines(values.mean(), column - 0.22, column + 0.22, color="black", linewidth=2.2, zorder=3)
    names = [textwrap.fill(chart.layout.marked(str(label)), 16, break_long_words=False) for label in frame.columns]
    axes.set_xticks(columns, names, parse_math=False)
    axes.set_ylabel(chart.axis.replace(", of ", "\nof "))
    grid(axes, "y")
    axes.set_xlim(-0.5, len(columns) - 0.5)
    if len(frame) <= LABELLED_TARGETS:
        _name_lines(axes, frame)


def _name_lines(axes: Axes, frame: pd.DataFrame) -> None:
    """Targets' names at the right end of their lines, pushed apart to at least a line of text."""
    last = frame.ffill(axis=1).iloc[:, -1].dropna().sort_values()
    low, high = axes.get_ylim()
    step = (high - low) / 17
    heights: list[float] = []
    for value in last:
        heights.append(max(float(value), heights[-1] + step if heights else -np.inf))
    excess = max(0.0, heights[-1] - high) if heights else 0.0
    edge = frame.shape[1] - 0.5
    for (name, value), height in zip(last.items(), heights, strict=True):
        axes.annotate(
            str(name),
            (frame.shape[1] - 1, value),
            (edge, height - excess),
            va="center",
            fontsize=8,
            annotation_clip=False,
            parse_math=False,
            arrowprops={"arrowstyle": "-", "color": PALE, "linewidth": 0.7},
        )
