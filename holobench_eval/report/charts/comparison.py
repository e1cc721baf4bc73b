"""The comparison figure: targets down, methods across, every capture at one to one or larger.

Each tile is the capture, its scores, and below it a window at four times its scale (left) and the error in that window
(right). Pictures are put together pixel by pixel before anything is drawn, so what is seen is what was scored.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from .gallery import CROP_FRACTION, Column, Picture, Tile, error_map, most_detailed
from .rows import CAPTION, CHARACTER, GAP, HEADER, SIDE, Page, tile_size
from .style import style

ZOOM = 4  # of the window, relative to its picture
FOOTER = 74
ERROR_COLOURS = "magma"


def outline(pixels: Picture, left: int, top: int, size: tuple[int, int]) -> None:
    """A white frame between black ones, seen on any picture."""
    for inset, value in ((0, 0.0), (1, 1.0), (2, 1.0), (3, 0.0)):
        inside = pixels[top + inset : top + size[0] - inset, left + inset : left + size[1] - inset]
        inside[[0, -1], :] = value
        inside[:, [0, -1]] = value


def draw_comparison(
    path: Path,
    title: str,
    targets: Sequence[tuple[str, Picture]],
    columns: Sequence[Column],
    error_scale: float,
) -> None:
    """Draw one page.

    targets: (name, picture (h, w, 3) sRGB in [0, 1]) of the rows, all of one size; columns: methods, whose tiles
    follow the order of ``targets``; error_scale: upper end of the colour bar of the error maps, sRGB value.
    """
    tall, wide = tile_size(targets[0][1].shape)
    row_height = tall + CAPTION + zoomed(targets[0][1].shape)[0] + 2 * GAP
    scale = Normalize(0, error_scale)
    with style():
        page = Page(SIDE + (1 + len(columns)) * (wide + GAP), HEADER + len(targets) * row_height + FOOTER)
        page.text(SIDE, 14, title, fontsize=9, weight="bold", va="center")
        for index, heading in enumerate(["target", *(column.title for column in columns)]):
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
    outline(
        page.pixels, left + crop.left * factor, top + crop.top * factor, (crop.height * factor, crop.width * factor)
    )


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
    coloured = np.asarray(matplotlib.colormaps[ERROR_COLOURS](scale(error)))[..., :3]
    page.paste(left + wide - size[1], below, size, coloured)


def _colour_bar(page: Page, scale: Normalize) -> None:
    height, width = page.pixels.shape[:2]
    box = (SIDE / width, (FOOTER - 22) / height, min(420, width - 2 * SIDE) / width, 14 / height)
    mappable = ScalarMappable(scale, ERROR_COLOURS)
    bar = page.figure.colorbar(mappable, cax=page.figure.add_axes(box), orientation="horizontal")
    words = "absolute error, mean over colours [share of full scale of sRGB values]"
    bar.set_label(textwrap.fill(words, int(box[2] * width / 5.5)), fontsize=8)
    bar.ax.tick_params(labelsize=8)
