"""The comparison figure: targets down, methods across, every capture at one to one or larger.

Each tile is the capture, its scores, and below it a window at four times its scale (left) and the error in that window
(right). Pictures are put together pixel by pixel before anything is drawn, so what is seen is what was scored.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from .gallery import CROP_FRACTION, Column, Picture, Tile, error_map, most_detailed
from .style import new_figure, save_picture, style

ZOOM = 4  # of the window, relative to its picture
SMALLEST_TILE = 160  # captures narrower than this many pixels are enlarged by a whole factor

GAP = 8
CAPTION = 20
HEADER = 52
SIDE = 30
FOOTER = 74
ERROR_COLOURS = "magma"
CHARACTER = 6.6  # width in pixels of an average character of the captions


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

    def outline(self, left: int, top: int, size: tuple[int, int]) -> None:
        """A white frame between black ones, seen on any picture."""
        for inset, value in ((0, 0.0), (1, 1.0), (2, 1.0), (3, 0.0)):
            rows = slice(top + inset, top + size[0] - inset)
            columns = slice(left + inset, left + size[1] - inset)
            inside = self.pixels[rows, columns]
            inside[[0, -1], :] = value
            inside[:, [0, -1]] = value

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


def draw_comparison(
    path: Path,
    title: str,
    targets: Sequence[tuple[str, Picture]],
    columns: Sequence[Column],
    error_scale: float,
    truth: str = "target",
) -> None:
    """Draw one page.

    targets: (name, picture (h, w, 3) sRGB in [0, 1]) of the rows, all of one size; columns: methods, whose tiles
    follow the order of ``targets``; error_scale: upper end of the colour bar of the error maps, sRGB value; truth: what
    the pictures of the rows are.
    """
    tall, wide = tile_size(targets[0][1].shape)
    row_height = tall + CAPTION + zoomed(targets[0][1].shape)[0] + 2 * GAP
    scale = Normalize(0, error_scale)
    with style():
        page = Page(SIDE + (1 + len(columns)) * (wide + GAP), HEADER + len(targets) * row_height + FOOTER)
        page.text(SIDE, 14, title, fontsize=9, weight="bold", va="center")
        for index, heading in enumerate([truth, *(column.title for column in columns)]):
            words = "\n".join(textwrap.wrap(heading, int(wide / CHARACTER), max_lines=2, placeholder="..."))
            page.text(SIDE + index * (wide + GAP) + wide / 2, HEADER - 4, words, ha="center", va="bottom")
        for row, (name, target) in enumerate(targets):
            top = HEADER + row * row_height
            label = textwrap.shorten(name, int(row_height / CHARACTER), placeholder="...")
            page.text(SIDE - 8, top + tall / 2, label, rotation=90, ha="right", va="center")
            _draw_target(page, (SIDE, top), target)
            for index, column in enumerate(columns, start=1):
                _draw_tile(page, (SIDE + index * (wide + GAP), top), column.tiles[row], target, scale)
        _colour_bar(page, scale)
        page.save(path)


def zoomed(shape: tuple[int, ...]) -> tuple[int, int]:
    """(height, width) in figure pixels of the enlarged window of a capture of ``shape`` (h, w, ...)."""
    tall, wide = tile_size(shape)
    return tall // shape[0] * ZOOM * (shape[0] // CROP_FRACTION), wide // shape[1] * ZOOM * (shape[1] // CROP_FRACTION)


def _draw_target(page: Page, corner: tuple[int, int], target: Picture) -> None:
    """The target, with a frame around the window that all tiles of its row enlarge."""
    left, top = corner
    tall, wide = tile_size(target.shape)
    page.paste(left, top, (tall, wide), target)
    words = f"frame: {ZOOM} x enlarged below"
    page.text(left + wide / 2, top + tall + CAPTION / 2, words, fontsize=8, ha="center", va="center")
    crop, factor = most_detailed(target), wide // target.shape[1]
    page.paste(left, top + tall + CAPTION, zoomed(target.shape), crop.of(target))
    page.outline(left + crop.left * factor, top + crop.top * factor, (crop.height * factor, crop.width * factor))


def _draw_tile(page: Page, corner: tuple[int, int], tile: Tile, target: Picture, scale: Normalize) -> None:
    """A capture, its caption, the enlarged window and the error in it; or why there is no capture."""
    left, top = corner
    tall, wide = tile_size(target.shape)
    page.tile(left, top, (tall, wide), tile)
    if tile.picture is None:
        return
    below, size, crop = top + tall + CAPTION, zoomed(target.shape), most_detailed(target)
    page.paste(left, below, size, crop.of(tile.picture))
    error = error_map(crop.of(tile.picture), crop.of(target))
    page.paste(left + wide - size[1], below, size, _coloured(error, scale))


def _coloured(error: NDArray[np.float64], scale: Normalize) -> Picture:
    coloured: Picture = np.asarray(matplotlib.colormaps[ERROR_COLOURS](scale(error)))[..., :3]
    return coloured


def _colour_bar(page: Page, scale: Normalize) -> None:
    height, width = page.pixels.shape[:2]
    box = (SIDE / width, (FOOTER - 22) / height, min(420, width - 2 * SIDE) / width, 14 / height)
    mappable = ScalarMappable(scale, ERROR_COLOURS)
    bar = page.figure.colorbar(mappable, cax=page.figure.add_axes(box), orientation="horizontal")
    words = "absolute error, mean over colours [share of full scale of sRGB values]"
    bar.set_label(textwrap.fill(words, int(box[2] * width / 5.5)), fontsize=8)
    bar.ax.tick_params(labelsize=8)
