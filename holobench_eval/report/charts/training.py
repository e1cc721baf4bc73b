"""Charts of training: what was predicted, what was captured, and how close the two are, on held-out images."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from ...study.artifacts import Round
from .style import COLOURS, PALE, new_figure, save, style

Rounds = tuple[str, tuple[Round, ...]]
"""A training's name and its rounds."""

WIDTH = 900
COLUMNS = 3
A_PAGE = 6
CHARACTER = 8.5
"""Width in pixels of an average character of a panel's title."""
CURVES = 12
"""Up to so many trainings have a panel each; more are rows of one chart of their last rounds."""
LINES = (
    ("predicted", "predicted picture, against the target", COLOURS[0], "o"),
    ("captured", "captured picture, against the target", COLOURS[1], "s"),
    ("fidelity", "prediction, against the capture (fidelity)", COLOURS[2], "^"),
)


def draw_trainings(stem: Path, found: Sequence[Rounds]) -> list[tuple[Path, bool]]:
    """Draw all trainings that have figures; the files, and whether each shows curves (or last rounds only).

    stem: the files' name without number and ending.
    """
    shown = [(name, kept) for name, rounds in found if (kept := tuple(filter(_has_figures, rounds)))]
    if not shown:
        return []
    if len(shown) > CURVES or all(len(rounds) == 1 for _, rounds in shown):
        path = stem.with_name(f"{stem.name}-last.png")
        last_rounds(path, [(name, rounds[-1:]) for name, rounds in shown])
        return [(path, False)]
    drawn = []
    for number, start in enumerate(range(0, len(shown), A_PAGE), start=1):
        path = stem.with_name(f"{stem.name}-{number}.png")
        curves(path, shown[start : start + A_PAGE], _limits(shown))
        drawn.append((path, True))
    return drawn


def _has_figures(one: Round) -> bool:
    return math.isfinite(one.captures) and any(math.isfinite(getattr(one, name)) for name, *_ in LINES)


@dataclass(frozen=True)
class _Limits:
    """The ranges of captures and of PSNR, one for all panels, so that they can be compared by eye."""

    captures: tuple[float, float]
    psnr: tuple[float, float]


def _limits(shown: Sequence[Rounds]) -> _Limits:
    values = np.array([getattr(one, name) for _, rounds in shown for one in rounds for name, *_ in LINES])
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    margin = max(0.5, 0.08 * (high - low))
    most = max(one.captures for _, rounds in shown for one in rounds)
    return _Limits((0.0, most * 1.06 + 0.5), (low - margin, high + margin))


def curves(path: Path, shown: Sequence[Rounds], limits: _Limits) -> None:
    """A panel per training: the three figures against the captures taken, a mark per round."""
    columns = min(COLUMNS, len(shown))
    rows = -(-len(shown) // columns)
    with style():
        figure = new_figure(WIDTH, 60 + 270 * rows)
        figure.set_layout_engine("constrained")
        panels = figure.subplots(rows, columns, squeeze=False, sharey=True)
        for place, axes in enumerate(panels.flat):
            if place >= len(shown):
                axes.remove()
                continue
            _curve(axes, shown[place][1], limits)
            title = textwrap.fill(
                shown[place][0],
                int(WIDTH / columns / CHARACTER),
                max_lines=2,
                placeholder="...",
                break_on_hyphens=False,
            )
            axes.set_title(title, loc="left", weight="bold", parse_math=False)
            if place % columns == 0:
                axes.set_ylabel("PSNR on held-out images [dB]")
        handles, labels = panels[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(LINES), frameon=False)
        save(figure, path)


def _curve(axes: Axes, rounds: tuple[Round, ...], limits: _Limits) -> None:
    captures = [one.captures for one in rounds]
    for key, label, colour, marker in LINES:
        axes.plot(captures, [getattr(one, key) for one in rounds], color=colour, marker=marker, label=label)
    axes.set_xlabel("captures taken for training")
    axes.set_xlim(*limits.captures)
    axes.set_ylim(*limits.psnr)
    axes.xaxis.set_major_locator(MaxNLocator(5, integer=True))
    axes.grid(color="#E5E5E5", linewidth=0.6)
    axes.set_axisbelow(True)


def last_rounds(path: Path, shown: Sequence[Rounds]) -> None:
    """A row per training with the three figures after its last round."""
    places = np.arange(len(shown))
    with style():
        figure = new_figure(WIDTH, 110 + 26 * len(shown))
        figure.set_layout_engine("constrained")
        axes = figure.subplots()
        last = [rounds[-1] for _, rounds in shown]
        values = np.array([[getattr(one, key) for key, *_ in LINES] for one in last])
        axes.hlines(places, np.nanmin(values, axis=1), np.nanmax(values, axis=1), color=PALE, linewidth=1.2)
        for column, (_, label, colour, marker) in enumerate(LINES):
            axes.plot(values[:, column], places, linestyle="", color=colour, marker=marker, label=label)
        names = [f"{_short(name)}, {one.captures:.0f} captures" for (name, _), one in zip(shown, last, strict=True)]
        axes.set_yticks(places, names, parse_math=False)
        axes.set_ylim(len(shown) - 0.5, -0.5)
        axes.tick_params(axis="y", length=0)
        axes.set_xlabel("PSNR on held-out images after the last round [dB]")
        axes.grid(axis="x", color="#E5E5E5", linewidth=0.6)
        axes.set_axisbelow(True)
        axes.set_title("after the last round of training", loc="left", weight="bold")
        figure.legend(loc="outside lower center", ncols=len(LINES), frameon=False)
        save(figure, path)


def _short(name: str) -> str:
    return name if len(name) <= 38 else f"{name[:35]}..."
