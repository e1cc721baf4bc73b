"""The form that all figures share: sizes, fonts, lines behind the data, repeatable bytes.

Colours and markers of methods are in ``look.methods``, sizes of the screen and of print in ``look.medium``.
"""

from __future__ import annotations

import io
import re
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import cv2
import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from numpy.typing import NDArray
from PIL import Image

from .look.medium import DPI, medium
from .look.methods import Look

QUALITIES = range(90, 20, -5)  # of a JPEG: the first that is small enough
LARGEST = 130_000  # bytes of a page of pictures
FULL_COLOUR = (cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444)

GREY = "#666666"
PALE = "#BBBBBB"
# Of what is no method: quantities that are learned, packages that are timed.
SHADES = ("#000000", "#777777", "#AAAAAA")


@contextmanager
def style() -> Iterator[None]:
    """Matplotlib's own defaults, whatever the user's matplotlibrc says, with this project's font sizes."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(
            {
                "font.size": medium().text,
                "axes.titlesize": medium().text + (medium().text > medium().note),
                "axes.spines.top": False,
                "axes.spines.right": False,
                "hatch.linewidth": 0.6,
                # Text stays text in print, and the names of its parts do not depend on chance.
                "pdf.fonttype": 42,
                "svg.fonttype": "none",
                "svg.hashsalt": "holobench_eval",
            }
        )
        yield


def new_figure(width: int, height: int) -> Figure:
    """An empty figure of ``width`` x ``height`` pixels; no pyplot, so no global state and no window."""
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def laid_out(width: int, height: int, rows: int = 1, columns: int = 1, **more: Any) -> tuple[Figure, NDArray[Any]]:
    """A figure of ``rows`` x ``columns`` panels with room for all words; more: as of ``Figure.subplots``."""
    figure = new_figure(width, height)
    figure.set_layout_engine("constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, **more)


def stacked(titles: Sequence[str], heights: Sequence[int], footer: int) -> tuple[Figure, list[Axes]]:
    """A column of panels with their titles; ``heights`` and ``footer`` in pixels of the screen."""
    ratios = list(heights) if len(set(heights)) > 1 else None
    height = round(medium().scale * (sum(heights) + footer))
    figure, panels = laid_out(medium().width, height, len(titles), height_ratios=ratios)
    for axes, title in zip(panels[:, 0], titles, strict=True):
        axes.set_title(title, loc="left", weight="bold", parse_math=False)
    return figure, list(panels[:, 0])


def marks(look: Look, size: float) -> dict[str, Any]:
    """How the marks of a method are plotted. size: on the screen [pt]."""
    edge, scaled = look.colour, size * medium().scale ** 2
    return {"marker": look.marker, "markersize": scaled, "markerfacecolor": look.face, "markeredgecolor": edge}


def note(axes: Axes, text: str, place: tuple[float, float], **more: Any) -> None:
    """Small words to the right of a place; more: as of ``Axes.annotate``."""
    given: dict[str, Any] = {"xytext": (5, 0), "textcoords": "offset points", "va": "center", "fontsize": medium().note}
    axes.annotate(text, place, **(given | more))


def grid(axes: Axes, axis: Literal["both", "x", "y"] = "both") -> None:
    """Pale lines behind everything that is drawn."""
    axes.grid(axis=axis, color="#E5E5E5", linewidth=0.6)
    axes.set_axisbelow(True)


def legend_below(figure: Figure, handles: Sequence[Artist], labels: Sequence[str]) -> None:
    """A legend below all panels, with as many columns as the names leave room for."""
    room = medium().characters(medium().width) // (max(map(len, labels)) + 8)
    columns = max(1, min(room, len(labels)))
    without_math(figure.legend(handles, labels, loc="outside lower center", ncols=columns, frameon=False))


def without_math(legend: Legend) -> None:
    """Show names as they are, dollar signs in them too."""
    for text in legend.get_texts():
        text.set_parse_math(False)


METADATA = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}


def save(figure: Figure, path: Path) -> None:
    """Write the figure as every file of the medium, without dates and versions: equal figures have equal bytes."""
    path.parent.mkdir(parents=True, exist_ok=True)
    for suffix in medium().suffixes:
        if suffix == ".png":
            _save_chart(figure, path.with_suffix(suffix))
        else:
            figure.savefig(path.with_suffix(suffix), dpi=DPI, metadata=METADATA[suffix])


def _save_chart(figure: Figure, path: Path) -> None:
    """A PNG of 256 colours, a third of the bytes: white stays white, colours are off by 9 of 255 where it was most."""
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=DPI)
    chart = Image.open(drawn).convert("RGB").quantize(method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    chart.save(path, dpi=(DPI, DPI), optimize=True)


def save_picture(pixels: NDArray[np.uint8], path: Path) -> None:
    """Write pixels ``(h, w, 3)``: as PNG, or as JPEG where the name says so.

    A JPEG keeps colours at full resolution (4:4:4), else speckle would look gray, and has the best of ``QUALITIES``
    that makes it small enough.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix.lower() == ".png":
        Image.fromarray(pixels).save(path, dpi=(DPI, DPI), optimize=True)
        return
    chosen = bisect_left(QUALITIES, True, key=lambda quality: len(_jpeg(pixels, quality)) <= LARGEST)
    path.write_bytes(_jpeg(pixels, QUALITIES[min(chosen, len(QUALITIES) - 1)]))


def _jpeg(pixels: NDArray[np.uint8], quality: int) -> bytes:
    settings = (*FULL_COLOUR, cv2.IMWRITE_JPEG_PROGRESSIVE, 1, cv2.IMWRITE_JPEG_QUALITY, quality)
    return cv2.imencode(".jpg", pixels[..., ::-1], settings)[1].tobytes()


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
