"""Pictures side by side: thumbnails of targets and captures, rows along a change, and a comparison with its errors.

Pictures are put together pixel by pixel before anything is drawn, so what is seen is what was scored. Large pictures of
a row are cut to their most detailed window, so that every pixel of it is seen in a file of moderate size. A tile of the
comparison is the capture, its scores, and below it a window at four times its scale (left) and the error in that window
(right).
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...core.errors import PictureError
from ...core.pictures import open_picture
from ...study.store import Store
from ..results import DONE, Results
from ..scores import Score
from .look import chart, medium, new_figure, save_picture, style

Picture = NDArray[np.float64]
Window = tuple[slice, slice]  # rows and columns of a picture
T = TypeVar("T")

CROP_FRACTION = 9  # of a side of the picture: four times enlarged, two windows fit below it


@dataclass(frozen=True)
class Tile:
    """One capture in a comparison: the picture ``(h, w, 3)`` sRGB in [0, 1], or None and the note why it is absent."""

    picture: Picture | None
    note: str


Row = tuple[str, Sequence[tuple[str, Tile]]]  # a method, and its captures by headings that are alike in all rows


def load_picture(path: Path) -> Picture | None:
    """A thumbnail as ``(h, w, 3)`` sRGB values in [0, 1]; None when the file is not there or damaged."""
    try:
        levels = open_picture(path.read_bytes()).values()
    except (OSError, PictureError):
        return None
    picture = levels.astype(np.float64) / 255
    if picture.ndim == 2:
        picture = np.repeat(picture[..., None], 3, axis=2)
    return picture


def most_detailed(target: Picture, fraction: int = CROP_FRACTION) -> Window:
    """The window of ``target`` with the largest summed gradient magnitude; the first one where windows tie.

    fraction: how many times smaller than the picture's its sides are.
    """
    height, width = target.shape[:2]
    rows, columns = max(1, height // fraction), max(1, width // fraction)
    vertical, horizontal = np.gradient(target.mean(axis=2))
    detail = np.hypot(vertical, horizontal)
    summed = np.pad(detail.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    windows = summed[rows:, columns:] - summed[:-rows, columns:] - summed[rows:, :-columns] + summed[:-rows, :-columns]
    # Six decimals: summation order must not decide between equal windows.
    top, left = map(int, np.unravel_index(int(np.argmax(np.round(windows, 6))), windows.shape))
    return np.s_[top : top + rows, left : left + columns]


def error_map(capture: Picture, target: Picture) -> NDArray[np.float64]:
    """``(h, w)`` absolute difference of sRGB values, mean over the three channels, in [0, 1]."""
    error: NDArray[np.float64] = np.abs(capture - target).mean(axis=2)
    return error


def error_limit(errors: Sequence[NDArray[np.float64]]) -> float:
    """The upper end of the shared error scale: the 99th percentile of all errors, rounded up to a tenth."""
    high = float(np.quantile(np.concatenate([error.ravel() for error in errors]), 0.99))
    return min(1.0, max(0.1, math.ceil(high * 10 - 1e-9) / 10))


def spread(items: Sequence[T], most: int) -> list[T]:
    """``most`` items or all where they are no more, evenly spaced from first to last, in their order."""
    picks = np.linspace(0, len(items) - 1, min(most, len(items))).round().astype(int)
    return [items[index] for index in picks]


COPIES = "pictures"  # folder of the small copies that a report keeps


class Thumbnails:
    """Pictures of a report's targets and captures, as far as they are there."""

    def __init__(self, results: Results, output: Path) -> None:
        """output: the folder of the report."""
        self.results, self.store, self.copies = results, Store(output), output / COPIES
        self._targets: dict[str, dict[str, Picture]] = {}

    def of_capture(self, cell: str) -> Path:
        """The file of a cell's capture: that of its record, or the small copy where the records are not there."""
        return self._there(self.store.thumbnail(cell))

    def of_target(self, target: str, shape: Sequence[int]) -> Path:
        """The same of a target as displays show it, ``(C, h, w)``."""
        return self._there(self.store.target_thumbnail(target, shape))

    def _there(self, thumbnail: Path) -> Path:
        return thumbnail if thumbnail.is_file() else self.copies / f"{thumbnail.stem}.webp"

    def targets(self, condition: str) -> dict[str, Picture]:
        """The targets that have a picture, as a display is to show them, in their order."""
        reference = self.results.reference(condition)
        shape = self.results.shape(reference)
        if reference not in self._targets:
            paths = {target: self.of_target(target, shape) for target in self.results.targets}
            pictures = ((target, load_picture(path)) for target, path in paths.items())
            self._targets[reference] = {target: picture for target, picture in pictures if picture is not None}
        return self._targets[reference]

    def tile(self, label: str, condition: str, target: str, most: int = 2) -> Tile:
        """The capture of the first repeat that is done, with at most so many of its scores, or why there is none."""
        cells = self.results.cells[label, condition]
        cells = cells[cells["target"] == target]
        if cells.empty:
            return Tile(None, "not planned")
        done = cells[cells["state"] == DONE]
        if done.empty:
            return Tile(None, f"{cells.iloc[0]['state']}: {cells.iloc[0]['reason']}")
        cell, shape = done.iloc[0], self.targets(condition)[target].shape
        picture = load_picture(self.of_capture(str(cell["cell"])))
        if picture is None:
            return Tile(None, "no thumbnail of this capture")
        if picture.shape != shape:
            return Tile(None, f"thumbnail is {picture.shape[1]} x {picture.shape[0]}, target {shape[1]} x {shape[0]}")
        scores = [self.results.headline, *(score for score in self.results.leading if score.metric == "ssim")][:most]
        return Tile(picture, noted(scores, cell))

    def typical(self, labels: Sequence[str], condition: str) -> list[str]:
        """The targets with a picture of each of these methods, those of differences nearest to the mean first."""
        known = self.targets(condition)
        return [
            target
            for target in self.results.near
            if target in known and all(self.tile(label, condition, target).picture is not None for label in labels)
        ]


def noted(scores: Sequence[Score], cell: pd.Series) -> str:
    """The scores of a cell for below its tile, which is narrow: that all are in focus stands there once."""
    focus = all(score.in_focus for score in scores)
    values = (
        f"{score.name if focus else score.title} {score.with_unit(float(cell[score.column]))}" for score in scores
    )
    return ("in focus: " if focus else "") + "   ".join(values)


SMALLEST_TILE = 160  # captures narrower than this many pixels are enlarged by a whole factor
GAP, CAPTION, HEADER, SIDE = 8, 20, 52, 30  # pixels
CHARACTER = 6.6  # width in pixels of an average character of the captions
LARGEST_TILE = 224  # pixels; of wider pictures a window is drawn, half as wide and high


def draw_rows(path: Path, title: str, target: tuple[str, Picture], rows: Sequence[Row]) -> None:
    """Draw the rows, the target ``(h, w, 3)`` to the left of the first. Nothing is drawn without rows."""
    if not rows:
        return
    name, picture = target
    window = most_detailed(picture, 2) if picture.shape[1] > LARGEST_TILE else np.s_[:, :]
    tall, wide = tile_size(picture[window].shape)
    columns = 1 + max(len(tiles) for _, tiles in rows)
    with style():
        page = Page(SIDE + columns * (wide + GAP), HEADER + len(rows) * (tall + CAPTION + GAP))
        page.text(SIDE, 14, title, fontsize=9, weight="bold", va="center")
        page.text(SIDE + wide / 2, HEADER - 4, f"target: {name}", ha="center", va="bottom")
        page.paste(SIDE, HEADER, (tall, wide), picture[window])
        for index, (method, tiles) in enumerate(rows):
            top = HEADER + index * (tall + CAPTION + GAP)
            label = textwrap.shorten(method, int(tall / CHARACTER), placeholder="...")
            page.text(SIDE - 8, top + tall / 2, label, rotation=90, ha="right", va="center")
            for column, (heading, tile) in enumerate(tiles, start=1):
                left = SIDE + column * (wide + GAP)
                if index == 0:
                    page.text(left + wide / 2, HEADER - 4, heading, ha="center", va="bottom")
                shown = tile if tile.picture is None else replace(tile, picture=tile.picture[window])
                page.tile(left, top, (tall, wide), shown)
        page.save(path)


def draw_wall(
    path: Path, title: str, below: str, rows: Mapping[str, tuple[Picture, Sequence[tuple[str, Tile]]]]
) -> None:
    """Draw a slide of captures, a row a target: its picture, then a capture a method; ``below`` all stands below."""
    columns = 1 + max(len(tiles) for _, tiles in rows.values())
    with chart(path, 0, len(rows), columns) as (figure, panels):
        figure.set_layout_engine("constrained", h_pad=0.12)  # a row's scores need room above the next row
        figure.suptitle(medium().wrap(title, 0.76 * medium().width), weight="bold", fontsize=1.25 * medium().text)
        figure.supxlabel(below, fontsize=medium().note, parse_math=False)
        letters = medium().characters(medium().width / columns)
        for row, (target, (picture, tiles)) in zip(panels, rows.items(), strict=True):
            for axes, (name, tile) in zip(row, [("target", Tile(picture, target)), *tiles], strict=True):
                axes.imshow(np.full_like(picture, 0.93) if tile.picture is None else tile.picture)
                axes.set(xticks=[], yticks=[])
                axes.spines[:].set_visible(False)
                axes.set_xlabel(textwrap.shorten(tile.note, letters, placeholder="..."), parse_math=False)
                if axes in panels[0]:
                    parts = textwrap.wrap(name.replace("_", "_ "), letters, max_lines=3, placeholder="...")
                    axes.set_title("\n".join(parts).replace("_ ", "_"), parse_math=False)


def tile_size(shape: tuple[int, ...]) -> tuple[int, int]:
    """(height, width) in figure pixels of a capture of ``shape`` (h, w, ...): a whole multiple of it."""
    factor = max(1, -(-SMALLEST_TILE // shape[1]))
    return shape[0] * factor, shape[1] * factor


class Page:
    """A page addressed in pixels from its top left corner: a picture for the tiles, a figure for the words."""

    def __init__(self, width: int, height: int) -> None:
        """width, height in pixels."""
        self.pixels: Picture = np.ones((height, width, 3))
        self.figure: Figure = new_figure(width, height)

    def paste(self, left: int, top: int, size: tuple[int, int], picture: Picture) -> None:
        """Copy ``picture`` into a box of ``size`` (height, width) by nearest neighbour."""
        rows, columns = (np.arange(n) * have // n for n, have in zip(size, picture.shape[:2], strict=True))
        self.pixels[top : top + size[0], left : left + size[1]] = picture[rows[:, None], columns]

    def tile(self, left: int, top: int, size: tuple[int, int], tile: Tile) -> None:
        """A capture with its caption below, or why there is none."""
        tall, wide = size
        if tile.picture is None:
            self.paste(left, top, size, np.full((1, 1, 3), 0.93))
            words = textwrap.fill(tile.note, int(wide / CHARACTER) - 2, max_lines=6, placeholder="...")
            self.text(left + wide / 2, top + tall / 2, words, fontsize=8, ha="center", va="center")
            return
        self.paste(left, top, size, tile.picture)
        self.text(left + wide / 2, top + tall + CAPTION / 2, tile.note, fontsize=8, ha="center", va="center")

    def text(self, x: float, y: float, words: str, **kwargs: Any) -> None:
        """Words at a point."""
        height, width = self.pixels.shape[:2]
        self.figure.text(x / width, 1 - y / height, words, parse_math=False, **kwargs)

    def save(self, path: Path) -> None:
        """Write the page: where there are words on the figure, or lines, they darken the picture."""
        canvas = FigureCanvasAgg(self.figure)
        canvas.draw()  # type: ignore[no-untyped-call]
        words = np.asarray(canvas.buffer_rgba())[..., :3]  # type: ignore[no-untyped-call]
        pixels = self.pixels[: words.shape[0], : words.shape[1]]  # the figure's size is rounded down
        save_picture((pixels * words).round().astype(np.uint8), path)


ZOOM = 4  # of the window, relative to its picture
FOOTER = 74
ERROR_COLOURS = "magma"


def draw_comparison(path: Path, title: str, target: Picture, columns: Sequence[tuple[str, str, Picture]]) -> None:
    """Draw one page of captures.

    target: ``(h, w, 3)`` sRGB in [0, 1]; columns: heading, note and capture.
    """
    tall, wide = tile_size(target.shape)
    window, factor = most_detailed(target), wide // target.shape[1]
    zoomed = tuple(ZOOM * factor * size for size in target[window].shape[:2])
    below = HEADER + tall + CAPTION
    scale = Normalize(0, error_limit([error_map(capture, target) for *_, capture in columns]))
    with style():
        page = Page(SIDE + (1 + len(columns)) * (wide + GAP), below + zoomed[0] + 2 * GAP + FOOTER)
        page.text(SIDE, 14, title, fontsize=9, weight="bold", va="center")
        for index, (heading, note, picture) in enumerate(
            [("target", f"frame: {ZOOM} x enlarged below", target), *columns]
        ):
            left = SIDE + index * (wide + GAP)
            words = "\n".join(textwrap.wrap(heading, int(wide / CHARACTER), max_lines=2, placeholder="..."))
            page.text(left + wide / 2, HEADER - 4, words, ha="center", va="bottom")
            page.tile(left, HEADER, (tall, wide), Tile(picture, note))
            page.paste(left, below, zoomed, picture[window])
            if index:
                error = scale(error_map(picture[window], target[window]))
                colours = np.asarray(matplotlib.colormaps[ERROR_COLOURS](error))[..., :3]
                page.paste(left + wide - zoomed[1], below, zoomed, colours)
        # A white frame between black ones, seen on any picture.
        top, bottom = (HEADER + factor * row for row in (window[0].start, window[0].stop))
        left, right = (SIDE + factor * column for column in (window[1].start, window[1].stop))
        for inset, value in enumerate((0.0, 1.0, 1.0, 0.0)):
            inside = page.pixels[top + inset : bottom - inset, left + inset : right - inset]
            inside[[0, -1], :] = inside[:, [0, -1]] = value
        _colour_bar(page, scale)
        page.save(path)


def _colour_bar(page: Page, scale: Normalize) -> None:
    height, width = page.pixels.shape[:2]
    box = (SIDE / width, (FOOTER - 22) / height, min(420, width - 2 * SIDE) / width, 14 / height)
    mappable = ScalarMappable(scale, ERROR_COLOURS)
    bar = page.figure.colorbar(mappable, cax=page.figure.add_axes(box), orientation="horizontal")
    words = "absolute error, mean over colours [share of full scale of sRGB values]"
    bar.set_label(textwrap.fill(words, int(box[2] * width / 5.5)), fontsize=8)
    bar.ax.tick_params(labelsize=8)
