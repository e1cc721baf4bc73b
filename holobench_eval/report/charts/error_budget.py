"""Error budgets: a stacked bar of shares for every display, and beside it the decibels that each link is worth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex, to_rgb
from matplotlib.patches import Patch

from .look import PALE, chart, grid, legend_below, medium, note

ROW, HEADER, LEGEND = 110, 40, 110  # pixels: of a display, above and below all
SHARES, GAINS = 0.6, 0.4  # of the width
LEGIBLE = 4.0  # percent from which on a part carries its number
REST, NOISE = PALE, "#333333"
NESTED = matplotlib.colormaps["cividis"]  # of nested models, from small to large: order is seen in gray too
DARKEST, LIGHTEST = 0.1, 0.9  # of the part of it that is used


def draw_budgets(path: Path, budgets: Sequence[Any]) -> None:
    """Draw the budgets of displays, see ``stories.error_budget.Budget``."""
    colours = _colours(budgets)
    narrow = medium().narrow
    shape = {"rows": 2} if narrow else {"columns": 2, "width_ratios": [SHARES, GAINS]}
    height = (HEADER + ROW * len(budgets) + LEGEND) * (1 + narrow)
    with chart(path, height, sharey=True, **shape) as (figure, panels):
        left, right = panels.flat
        for row, budget in enumerate(budgets):
            _shares(left, row, budget, colours)
            _gains(right, row, budget, colours)
        names = [f"{budget.condition}\n{budget.psnr.mean:.2f} dB" for budget in budgets]
        left.set_yticks(range(len(budgets)), names, parse_math=False)
        left.set_ylim(len(budgets) - 0.5, -0.5)
        left.axvline(0, color="black", linewidth=0.8)
        left.set_xlabel("share of the squared error of the captures [%]")
        left.set_title("what explains the error", loc="left", weight="bold")
        gained = "PSNR gained if it were removed, with all to its left [dB]"
        right.set_xlabel(medium().wrap(gained, (0.7 if narrow else 0.9 * GAINS) * medium().width))
        right.set_title("what its removal is worth at most", loc="left", weight="bold")
        right.set_xlim(left=min(0.0, right.get_xlim()[0]))
        for axes in (left, right):
            axes.tick_params(axis="y", length=0)
            grid(axes, "x")
        legend_below(figure, [Patch(facecolor=colour) for colour in colours.values()], list(colours))


def _colours(budgets: Sequence[Any]) -> Mapping[str, str]:
    """Of every part by its label, in the order of the bars."""
    labels = dict.fromkeys(part.label for budget in budgets for part in budget.explained)
    shades = np.linspace(DARKEST, LIGHTEST, len(labels))
    explained = {label: to_hex(NESTED(shade)) for label, shade in zip(labels, shades, strict=True)}
    return explained | {budgets[0].rest.label: REST, budgets[0].noise.label: NOISE}


def _shares(axes: Axes, row: int, budget: Any, colours: Mapping[str, str]) -> None:
    """The parts side by side from zero on; negative ones to its left, hatched."""
    right = left = 0.0
    for part in budget.parts:
        share = 100 * part.share.mean
        start = right if share >= 0 else left
        hatch = "////" if share < 0 else None
        colour = colours[part.label]
        axes.barh(row, share, left=start, height=0.5, color=colour, edgecolor="white", linewidth=0.5, hatch=hatch)
        if abs(share) >= LEGIBLE:
            is_dark = float(np.dot(to_rgb(colour), (0.3, 0.6, 0.1))) < 0.5
            ink = "white" if is_dark and share > 0 else "black"
            axes.text(start + share / 2, row, f"{share:.0f}", ha="center", va="center", color=ink)
        right, left = (right + share, left) if share >= 0 else (right, left + share)


def _gains(axes: Axes, row: int, budget: Any, colours: Mapping[str, str]) -> None:
    """A mark with its interval for each link of the chain, from above to below, and one for the noise alone."""
    links: list[Any] = [*budget.explained, budget.noise]
    heights = row + np.linspace(-0.3, 0.3, len(links))
    for part, height in zip(links, heights, strict=True):
        if part.gain is None:
            continue
        colour = colours[part.label]
        axes.errorbar(part.gain.mean, height, xerr=part.gain.reach, fmt="o", color=colour, markersize=5, capsize=2)
        end = part.gain.mean + part.gain.reach[1, 0]
        note(axes, f"{part.gain.mean:z.1f}", (end, height))
