"""Which displays have published figures: values of pairs of parameters, of all draws and of those that fit."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ...study.calibration.family import Range, Row
from .look.medium import medium
from .style import PALE, new_figure, save, style

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
                if down == count - 1:
                    panel.set_xlabel(_named(horizontal), **label)
                else:
                    panel.set_xticklabels([])
                if across == 0 and down:
                    panel.set_ylabel(_named(vertical), **label)
                elif across:
                    panel.set_yticklabels([])
                panel.tick_params(labelsize=medium().note)
        save(figure, path)


def _named(given: Range) -> str:
    words = medium().wrap(given.words, SIDE)
    return f"{words}\n[{given.unit}]" if given.unit else words
