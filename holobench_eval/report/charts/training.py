"""Charts of training: what was predicted, what was captured, and how close the two are, on held-out images."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from ...study.artifacts import Round
from .look.medium import medium
from .style import SHADES, grid, laid_out, legend_below, save, style

Rounds = tuple[str, tuple[Round, ...]]  # a training's name and its rounds
Limits = tuple[tuple[float, float], tuple[float, float]]  # of captures, and of PSNR [dB]

COLUMNS = 3
A_PAGE = 6
NARROWEST = 200  # pixels of a panel
MOST = 12  # trainings with a panel each; of more, the table alone is in the report
LINES = (
    ("predicted", "predicted picture, against the target", SHADES[0], "o"),
    ("captured", "captured picture, against the target", SHADES[1], "s"),
    ("fidelity", "prediction, against the capture (fidelity)", SHADES[2], "^"),
)


def draw_trainings(stem: Path, trainings: Sequence[Rounds]) -> list[Path]:
    """Draw the trainings that have several rounds, where they are few enough to be looked at; the files.

    stem: the files' name without number and ending.
    """
    drawable = [(name, kept) for name, rounds in trainings if (kept := tuple(filter(_has_figures, rounds)))]
    if len(drawable) > MOST or all(len(rounds) == 1 for _, rounds in drawable):
        return []
    drawn = []
    for number, start in enumerate(range(0, len(drawable), A_PAGE), start=1):
        drawn.append(stem.with_name(f"{stem.name}-{number}.png"))
        curves(drawn[-1], drawable[start : start + A_PAGE], _limits(drawable))
    return drawn


def _has_figures(step: Round) -> bool:
    return math.isfinite(step.captures) and any(math.isfinite(getattr(step, name)) for name, *_ in LINES)


def _limits(trainings: Sequence[Rounds]) -> Limits:
    """The ranges of captures and of PSNR, one for all panels, so that they can be compared by eye."""
    values = np.array([getattr(step, name) for _, rounds in trainings for step in rounds for name, *_ in LINES])
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    margin = max(0.5, 0.08 * (high - low))
    most = max(step.captures for _, rounds in trainings for step in rounds)
    return (0.0, most * 1.06 + 0.5), (low - margin, high + margin)


def curves(path: Path, trainings: Sequence[Rounds], limits: Limits) -> None:
    """A panel per training: the three figures against the captures taken, a mark per round."""
    columns = min(COLUMNS, len(trainings), medium().width // NARROWEST)
    rows = -(-len(trainings) // columns)
    with style():
        height = round(medium().scale * (60 + 270 * rows))
        figure, panels = laid_out(medium().width, height, rows, columns, sharey=True)
        for index, axes in enumerate(panels.flat):
            if index >= len(trainings):
                axes.remove()
                continue
            name, steps = trainings[index]
            _curve(axes, steps, limits)
            title = textwrap.fill(
                name,
                medium().characters(0.85 * medium().width / columns),
                max_lines=2,
                placeholder="...",
                break_on_hyphens=False,
            )
            axes.set_title(title, loc="left", weight="bold", parse_math=False)
            if index % columns == 0:
                axes.set_ylabel("PSNR on held-out images [dB]")
        legend_below(figure, *panels[0, 0].get_legend_handles_labels())
        save(figure, path)


def _curve(axes: Axes, rounds: tuple[Round, ...], limits: Limits) -> None:
    captures = [step.captures for step in rounds]
    for key, label, colour, marker in LINES:
        axes.plot(captures, [getattr(step, key) for step in rounds], color=colour, marker=marker, label=label)
    axes.set(xlabel="captures taken for training", xlim=limits[0], ylim=limits[1])
    axes.xaxis.set_major_locator(MaxNLocator(5, integer=True))
    grid(axes)
