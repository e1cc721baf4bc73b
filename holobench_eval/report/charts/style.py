"""One look for every figure: size in pixels, colours that colour-blind readers can tell apart, repeatable bytes."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

DPI = 100
WIDTH = 900  # pixels of most figures
QUALITY = 82  # of a JPEG

# Okabe & Ito's palette without its yellow, which is too faint for marks on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#6A3D9A", "#7F5539")
GREY = "#666666"
PALE = "#BBBBBB"


@contextmanager
def style() -> Iterator[None]:
    """Matplotlib's own defaults, whatever the user's matplotlibrc says, with this project's font sizes."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(
            {
                "font.size": 9,
                "axes.titlesize": 10,
                "axes.spines.top": False,
                "axes.spines.right": False,
                "hatch.linewidth": 0.6,
            }
        )
        yield


def new_figure(width: int, height: int) -> Figure:
    """An empty figure of ``width`` x ``height`` pixels; no pyplot, so no global state and no window."""
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def stacked(
    titles: Sequence[str], heights: Sequence[int], footer: int, width: int = WIDTH
) -> tuple[Figure, list[Axes]]:
    """A column of panels with their titles; ``heights``, ``footer`` and ``width`` in pixels."""
    ratios = list(heights) if len(set(heights)) > 1 else None
    figure = new_figure(width, sum(heights) + footer)
    figure.set_layout_engine("constrained")
    panels = figure.subplots(len(titles), 1, squeeze=False, height_ratios=ratios)[:, 0]
    for axes, title in zip(panels, titles, strict=True):
        axes.set_title(title, loc="left", weight="bold", parse_math=False)
    return figure, list(panels)


def grid(axes: Axes, axis: Literal["both", "x", "y"] = "both") -> None:
    """Pale lines behind everything that is drawn."""
    axes.grid(axis=axis, color="#E5E5E5", linewidth=0.6)
    axes.set_axisbelow(True)


def save(figure: Figure, path: Path) -> None:
    """Write the figure without the version stamp, so that equal figures have equal bytes.

    As PNG, or as JPEG where the name says so: pages of speckle are ten times as large as PNG.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".jpg":
        figure.savefig(path, dpi=DPI, pil_kwargs={"quality": QUALITY})
    else:
        figure.savefig(path, dpi=DPI, metadata={"Software": None})


def save_picture(pixels: NDArray[np.uint8], path: Path) -> None:
    """Write pixels ``(h, w, 3)`` as ``save`` writes a figure, without drawing them first."""
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(pixels).save(path, quality=QUALITY, dpi=(DPI, DPI))


def slugs(names: Sequence[str]) -> dict[str, str]:
    """File-name stems for condition names: safe characters only, and different names keep different stems."""
    stems: dict[str, str] = {}
    for name in names:
        stem = base = re.sub(r"[^A-Za-z0-9._-]+", "-", name).strip("-.") or "condition"
        count = 1
        while stem in stems.values():
            count += 1
            stem = f"{base}-{count}"
        stems[name] = stem
    return stems
