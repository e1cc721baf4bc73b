"""What all figures share: the colour and marker of each method, the medium, sizes, fonts, repeatable bytes.

A hue is a family of methods, a marker a method in it, a tint a variant of a method within a study. The hues were
searched by chance for the largest smallest difference (CIEDE2000, Sharma, Wu & Dalal, Color Res. Appl. 30, 2005) to
normal eyes, to deuteranopes and protanopes (simulated as in Machado, Oliveira & Fernandes, IEEE TVCG 15, 2009) and in
gray; ``tests/report/charts/test_look.py`` measures them. No hue is used twice: a method that is not in the registry is
gray, with a marker of its own as far as there are markers, and charts write its name beside it.
"""

from __future__ import annotations

import hashlib
import io
import re
import textwrap
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import cv2
import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

NAVY, ORANGE, GREEN, MAGENTA = "#002E6B", "#D56615", "#238655", "#B82686"
AMBER, SKY, VIOLET, CRIMSON = "#F4A610", "#0BA4D9", "#431CFC", "#861323"
HUES = (NAVY, ORANGE, GREEN, MAGENTA, AMBER, SKY, VIOLET, CRIMSON)
BLACK, WHITE = "#000000", "#FFFFFF"
NEUTRAL = "#888888"  # of methods that are not in the registry
PALEST = 0.85  # share of white in the face of a method's last variant
MARKERS = "osD^v<>PXp*"

FAMILIES = {  # method:marker of each hue
    NAVY: "wirtinger:o wirtinger_gamma:s wirtinger_veil:P nearest_level:^ through:D",
    ORANGE: "hil_plus:* holonet:o ccnn:s tensor_holography:D unet_phase:^",
    GREEN: (
        "parametric_model:s partially_coherent_model:P hybrid_model:D twin:* learned_kernel:^ cnn_prop_cnn:v "
        "image_terms:< image_network:> field_network:o"
    ),
    MAGENTA: "hil:P hil_tuned:X hil_nh3d:p hil_terms:*",
    AMBER: "double_phase:^ double_phase_aa:v double_phase_bl:< double_phase_gamma:>",
    SKY: (
        "sgd:D odak_sgd:o torchoptics_adam:s straight_through:P gumbel:* random_frames:p light_field:X "
        "focal_stack:h partially_coherent:v phases:^"
    ),
    VIOLET: "online_camera:D online_camera_network:s",
    CRIMSON: "gerchberg_saxton:s hio:D multi_plane:p",
    BLACK: "oracle:D",
}
MEMBERS = {hue: dict(each.split(":") for each in members.split()) for hue, members in FAMILIES.items()}
REGISTRY = {name: (hue, marker) for hue, members in MEMBERS.items() for name, marker in members.items()}


@dataclass(frozen=True)
class Look:
    """How a method is drawn: a marker, its colour (``#RRGGBB``, of lines and edges too) and that of its face."""

    colour: str
    marker: str
    face: str

    def marks(self, size: float) -> dict[str, Any]:
        """How its marks are plotted. size: on the screen [pt]."""
        given = {"marker": self.marker, "markersize": size * medium().scale, "markerfacecolor": self.face}
        return given | {"markeredgecolor": self.colour}


def look(name: str, variant: int = 0, variants: int = 1) -> Look:
    """The look of a method by its registered name, or by ``path/to/file.py:Name``, of which the class counts.

    variant, variants: which of how many rows of the method it is; later ones have paler faces.
    """
    chance = hashlib.sha256(name.rpartition(":")[2].encode()).digest()[0]  # depends on the name alone
    colour, marker = REGISTRY.get(name, (NEUTRAL, MARKERS[chance % len(MARKERS)]))
    if name == "oracle":
        return Look(colour, marker, WHITE)
    white = PALEST * variant / (variants - 1) if variants > 1 else 0.0
    red, green, blue = (share + white * (1 - share) for share in to_rgb(colour))
    return Look(colour, marker, to_hex((red, green, blue)).upper())


def looks(names: Mapping[str, str]) -> dict[str, Look]:
    """The look of every row of a study. names: the registered name of each label, in the order of the config."""
    variants, seen, result = Counter(names.values()), Counter[str](), {}
    for label, name in names.items():
        result[label] = look(name, seen[name], variants[name])
        seen[name] += 1
    return result


DPI = 100
MILLIMETRES = 25.4  # an inch
NARROW = 500  # pixels
ADVANCE = 0.6  # of the font's size, that an average character is wide


@dataclass(frozen=True)
class Medium:
    """width: of a figure [pixels of 1/100 inch]; text, note: sizes of labels and of what stands beside marks [pt];
    suffixes: the files that a chart is written as; height: of all figures, where they are slides [pixels]."""

    width: int
    text: float
    note: float
    suffixes: tuple[str, ...]
    height: int = 0

    @property
    def scale(self) -> float:
        """Of heights that were chosen for the screen."""
        return self.text / SCREEN.text

    @property
    def narrow(self) -> bool:
        """Whether panels, their names and their legends stand below each other and not side by side."""
        return self.width < NARROW

    def characters(self, pixels: float) -> int:
        """How many characters of a label fit a width [pixels], at least eight."""
        return max(8, int(pixels / (ADVANCE * self.text * DPI / 72)))

    def wrap(self, words: str, pixels: float) -> str:
        """Words in lines that fit a width [pixels]."""
        return textwrap.fill(words, self.characters(pixels), break_long_words=False, break_on_hyphens=False)


SCREEN = Medium(900, 9, 8, (".png",))
# A column and two columns of the ACM's and of most journals are 84 and 174 mm wide; 7 pt is the smallest font that they
# accept. A slide of 16:9 is 1280 pixels wide, and read from the last row.
MEDIA = {
    "talk": Medium(1280, 16, 14, (".png", ".svg"), 720),
    "column": Medium(int(84 * DPI / MILLIMETRES), 7, 7, (".pdf", ".svg")),
    "double": Medium(int(174 * DPI / MILLIMETRES), 7, 7, (".pdf", ".svg")),
}

_current = ContextVar("medium", default=SCREEN)
medium = _current.get


@contextmanager
def drawn_for(chosen: Medium) -> Iterator[None]:
    """Draw the figures within for another medium."""
    token = _current.set(chosen)
    try:
        yield
    finally:
        _current.reset(token)


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


@contextmanager
def chart(
    path: Path, height: float, rows: int = 1, columns: int = 1, width: int | None = None, **more: Any
) -> Iterator[tuple[Figure, NDArray[Any]]]:
    """A figure of ``rows`` x ``columns`` panels with room for all words, written when it is drawn.

    height: in pixels of the screen, of a slide its own; width: in pixels; more: as of ``Figure.subplots``.
    """
    with style():
        figure = new_figure(width or medium().width, medium().height or round(medium().scale * height))
        figure.set_layout_engine("constrained")
        yield figure, figure.subplots(rows, columns, squeeze=False, **more)
        save(figure, path)


def stacked(path: Path, titles: Sequence[str], heights: Sequence[int], footer: int, xlabel: str = "") -> Iterator[Axes]:
    """Panels with their titles, one below the other on the screen; elsewhere each is a figure with a name of its own.

    heights, footer: in pixels of the screen; xlabel: of the last panel of a figure.
    """
    panels = dict(zip(titles, heights, strict=True))
    figures = {path: panels}
    if medium() is not SCREEN and len(titles) > 1:
        stems = slugs(titles).items()
        figures = {path.with_name(f"{path.stem}-{stem}.png"): {title: panels[title]} for title, stem in stems}
    for own, each in figures.items():
        ratios = list(each.values()) if len(set(each.values())) > 1 else None
        with chart(own, sum(each.values()) + footer, len(each), height_ratios=ratios) as (_, drawn):
            drawn[-1, 0].set_xlabel(medium().wrap(xlabel, 0.8 * medium().width))
            for axes, title in zip(drawn[:, 0], each, strict=True):
                axes.set_title(title, loc="left", weight="bold", parse_math=False)
                yield axes


def note(axes: Axes, text: str, place: tuple[float, float], **more: Any) -> None:
    """Small words to the right of a place; more: as of ``Axes.annotate``."""
    given: dict[str, Any] = {"xytext": (5, 0), "textcoords": "offset points", "va": "center", "fontsize": medium().note}
    axes.annotate(text, place, **(given | more))


def grid(axes: Axes, axis: Literal["both", "x", "y"] = "both") -> None:
    """Pale lines behind everything that is drawn."""
    axes.grid(axis=axis, color="#E5E5E5", linewidth=0.6)
    axes.set_axisbelow(True)


def legend_below(figure: Figure, handles: Sequence[Artist], labels: Sequence[str]) -> int:
    """A legend below all panels, with as many columns as the names leave room for; its rows."""
    room = medium().characters(medium().width) // (max(map(len, labels)) + 8)
    columns = max(1, min(room, len(labels)))
    legend = figure.legend(handles, labels, loc="outside lower center", ncols=columns, frameon=False)
    for text in legend.get_texts():
        text.set_parse_math(False)
    return -(-len(labels) // columns)


def legend_beside(axes: Axes) -> None:
    """A legend to the right of a panel; a narrow figure has it below, and grows by it."""
    figure = axes.get_figure(root=True)
    if medium().narrow and figure is not None:
        rows = legend_below(figure, *axes.get_legend_handles_labels())
        figure.set_figheight(figure.get_figheight() + rows * 1.7 * medium().text / 72)
        return
    legend = axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False, fontsize=medium().note)
    for text in legend.get_texts():
        text.set_parse_math(False)


METADATA = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}


def save(figure: Figure, path: Path) -> None:
    """Write the figure as every file of the medium, without dates and versions: equal figures have equal bytes.

    A PNG has 256 colours, a third of the bytes: white stays white, colours are off by 9 of 255 where it was most.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    for suffix in medium().suffixes:
        if suffix != ".png":
            figure.savefig(path.with_suffix(suffix), dpi=DPI, metadata=METADATA[suffix])
            continue
        drawn = io.BytesIO()
        figure.savefig(drawn, format="png", dpi=DPI)
        few = Image.open(drawn).convert("RGB").quantize(method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
        few.save(path.with_suffix(suffix), dpi=(DPI, DPI), optimize=True)


QUALITIES = range(90, 20, -5)  # of a JPEG: the first that is small enough
LARGEST = 130_000  # bytes of a page of pictures
FULL_COLOUR = (cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444)


def save_picture(pixels: NDArray[np.uint8], path: Path) -> None:
    """Write pixels ``(h, w, 3)``: as PNG, or as JPEG where the name says so.

    A JPEG keeps colours at full resolution (4:4:4), else speckle would look gray, and has the best of ``QUALITIES``
    that makes it small enough.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix.lower() == ".png":
        Image.fromarray(pixels).save(path, dpi=(DPI, DPI), optimize=True)
        return

    def jpeg(quality: int) -> bytes:
        settings = (*FULL_COLOUR, cv2.IMWRITE_JPEG_PROGRESSIVE, 1, cv2.IMWRITE_JPEG_QUALITY, quality)
        return cv2.imencode(".jpg", pixels[..., ::-1], settings)[1].tobytes()

    chosen = bisect_left(QUALITIES, True, key=lambda quality: len(jpeg(quality)) <= LARGEST)
    path.write_bytes(jpeg(QUALITIES[min(chosen, len(QUALITIES) - 1)]))


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
