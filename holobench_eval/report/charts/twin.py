"""A display beside its twin: photographs, captures and what differs between them; and scores on both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from ...optics.colour import srgb_encode
from .look.medium import medium
from .look.methods import Look
from .style import GREY, PALE, grid, laid_out, save, save_picture, style, without_math

SIDE, FRAME = 250, 90  # pixels: of a picture, around all
LOUDER = 4.0  # factor of differences

Picture = NDArray[np.float32]


def draw_twin_pictures(path: Path, rows: Mapping[str, tuple[Picture, Picture, Picture]]) -> None:
    """Draw photographs ``(C, h, w)`` in [0, 1], second photographs and captures of the twin, a row a method, and the
    differences of both to the first."""
    titles = (
        "photograph", "capture of the twin", f"difference to the twin, x {LOUDER:g}",
        f"of two photographs, x {LOUDER:g}",
    )  # fmt: skip
    with style():
        width, height = (SIDE * len(each) + FRAME for each in (titles, rows))
        figure, panels = laid_out(width, height, len(rows), len(titles))
        for line, (label, (first, second, twin)) in zip(panels, rows.items(), strict=True):
            shown = (first, twin, LOUDER * np.abs(twin - first), LOUDER * np.abs(second - first))
            for axes, title, picture in zip(line, titles, shown, strict=True):
                _show(axes, picture)
                if axes in panels[0]:
                    axes.set_title(title, fontsize=medium().note)
            line[0].set_ylabel(label, parse_math=False)
        figure.canvas.draw()
        pixels = np.asarray(figure.canvas.buffer_rgba())[..., :3]  # type: ignore[attr-defined]
        save_picture(np.ascontiguousarray(pixels), path)


def _show(axes: Axes, picture: Picture) -> None:
    import torch

    light = srgb_encode(torch.from_numpy(np.clip(picture, 0, 1))).numpy()
    image = np.moveaxis(np.repeat(light, 3, 0) if len(light) == 1 else light, 0, -1)
    axes.imshow(image, interpolation="nearest")
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set_visible(False)


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
