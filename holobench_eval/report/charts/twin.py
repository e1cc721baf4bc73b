"""A display beside its twin: photographs, captures and what differs between them; and scores on both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from ...optics.colour import srgb_encode
from .look.medium import medium
from .look.methods import Look
from .style import GREY, PALE, grid, laid_out, save, style, without_math
from .tiles import Picture, Tile, draw_rows

LOUDER = 4.0  # factor of differences
TITLES = ("photograph", "capture of the twin", f"difference, x {LOUDER:g}", f"of two photographs, x {LOUDER:g}")


def draw_twin_pictures(
    path: Path, title: str, target: tuple[str, Tensor], rows: Mapping[str, tuple[Tensor, Tensor, Tensor]]
) -> None:
    """Draw a target ``(C, h, w)`` in [0, 1] by its name, and beside it photographs, captures of the twin, and the
    differences of those and of second photographs to the first; rows: photograph, second one and capture by method."""
    drawn = []
    for label, (first, second, twin) in rows.items():
        shown = (first, twin, LOUDER * (twin - first).abs(), LOUDER * (second - first).abs())
        drawn.append((label, [(name, Tile(_seen(each), "")) for name, each in zip(TITLES, shown, strict=True)]))
    draw_rows(path, title, (target[0], _seen(target[1])), drawn)


def _seen(light: Tensor) -> Picture:
    return srgb_encode(light.clamp(0, 1)).expand(3, -1, -1).permute(1, 2, 0).double().numpy()


def draw_twin_scores(
    path: Path,
    display: Mapping[str, NDArray[np.float64]],
    twin: Mapping[str, NDArray[np.float64]],
    looks: Mapping[str, Look],
    others: Sequence[Mapping[str, NDArray[np.float64]]],
) -> None:
    """Draw the score of each picture on the twin over that on the display, a colour a method; of ``others`` pale."""
    with style():
        side = round(medium().scale * 480)
        figure, ((axes,),) = laid_out(round(1.45 * side), side)
        every = np.concatenate([*display.values(), *twin.values()])
        ends = np.array([every.min() - 0.5, every.max() + 0.5])
        axes.plot(ends, ends, color=GREY, linewidth=0.8, label="as on the display")
        for number, other in enumerate(others):
            for label, scores in other.items():
                marker = "x+"[number % 2]
                axes.scatter(display[label], scores, s=18, color=PALE, marker=marker, linewidths=0.8)
        for label, scores in twin.items():
            own = looks[label]
            axes.scatter(
                display[label], scores, s=34, marker=own.marker, facecolor=own.face, edgecolor=own.colour, label=label
            )
        axes.set(xlim=ends, ylim=ends, aspect="equal")
        axes.set(xlabel="PSNR on the display [dB]", ylabel="PSNR on the twin [dB]")
        grid(axes)
        without_math(axes.legend(loc="center left", bbox_to_anchor=(1.02, 0.5), frameon=False))
        save(figure, path)
