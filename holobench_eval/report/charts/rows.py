"""Rows of pictures of one target along a change of the display, as in paper Fig. 10.

Large pictures are cut to their most detailed window, so that every pixel of it is seen in a file of moderate size.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from .comparison import CAPTION, CHARACTER, GAP, HEADER, SIDE, Page, tile_size
from .gallery import Crop, Picture, Tile, most_detailed
from .style import style

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
