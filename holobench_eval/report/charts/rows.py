"""Rows of pictures of one target along a change of the display, as in paper Fig. 10.

Large pictures are cut to their most detailed window, so that every pixel of it is seen in a file of moderate size.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from .gallery import Crop, Picture, Tile, most_detailed
from .style import new_figure, save_picture, style

SMALLEST_TILE = 160  # captures narrower than this many pixels are enlarged by a whole factor
GAP, CAPTION, HEADER, SIDE = 8, 20, 52, 30  # pixels
CHARACTER = 6.6  # width in pixels of an average character of the captions
LARGEST_TILE = 224  # pixels; of wider pictures a window is drawn, half as wide and high


@dataclass(frozen=True)
class Row:
    """A method's captures. tiles: (heading, capture), headings alike in all rows."""

    label: str
    tiles: tuple[tuple[str, Tile], ...]


def draw_rows(path: Path, title: str, target: tuple[str, Picture], rows: Sequence[Row]) -> None:
    """Draw the rows, the target ``(h, w, 3)`` to the left of the first. Nothing is drawn without rows."""
    if not rows:
        return
    name, picture = target
    window = most_detailed(picture, 2) if picture.shape[1] > LARGEST_TILE else Crop(0, 0, *picture.shape[:2])
    tall, wide = tile_size(window.of(picture).shape)
    columns = 1 + max(len(row.tiles) for row in rows)
    with style():
        page = Page(SIDE + columns * (wide + GAP), HEADER + len(rows) * (tall + CAPTION + GAP))
        page.text(SIDE, 14, title, fontsize=9, weight="bold", va="center")
        page.text(SIDE + wide / 2, HEADER - 4, f"target: {name}", ha="center", va="bottom")
        page.paste(SIDE, HEADER, (tall, wide), window.of(picture))
        for index, row in enumerate(rows):
            top = HEADER + index * (tall + CAPTION + GAP)
            label = textwrap.shorten(row.label, int(tall / CHARACTER), placeholder="...")
            page.text(SIDE - 8, top + tall / 2, label, rotation=90, ha="right", va="center")
            for column, (heading, tile) in enumerate(row.tiles, start=1):
                left = SIDE + column * (wide + GAP)
                if index == 0:
                    page.text(left + wide / 2, HEADER - 4, heading, ha="center", va="bottom")
                shown = tile if tile.picture is None else replace(tile, picture=window.of(tile.picture))
                page.tile(left, top, (tall, wide), shown)
        page.save(path)


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
