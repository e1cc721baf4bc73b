"""A display beside its twin: photographs, captures and what differs between them; and scores on both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from ...optics.colour import srgb_encode
from .look import GREY, PALE, Look, chart, grid, legend_beside
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
    with chart(path, 480, width=696) as (_, ((axes,),)):
        scores = np.concatenate([*display.values(), *twin.values()])
        ends = np.array([scores.min() - 0.5, scores.max() + 0.5])
        axes.plot(ends, ends, color=GREY, linewidth=0.8, label="as on the display")
        for number, other in enumerate(others):
            for label, scores in other.items():
                axes.scatter(display[label], scores, s=18, color=PALE, marker="x+"[number % 2], linewidths=0.8)
        for label, scores in twin.items():
            given = {"marker": looks[label].marker, "facecolor": looks[label].face, "edgecolor": looks[label].colour}
            axes.scatter(display[label], scores, s=34, label=label, **given)
        axes.set(
            xlim=ends, ylim=ends, aspect="equal", xlabel="PSNR on the display [dB]", ylabel="PSNR on the twin [dB]"
        )
        grid(axes)
        legend_beside(axes)
