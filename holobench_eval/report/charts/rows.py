"""Rows of pictures of one target along a change of the display, as in paper Fig. 10."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from .comparison import CAPTION, CHARACTER, GAP, HEADER, SIDE, Page, tile_size
from .gallery import Picture, Tile
from .style import style


@dataclass(frozen=True)
class Row:
    """A method's captures. tiles: (heading, capture), headings alike in all rows."""

    label: str
    tiles: tuple[tuple[str, Tile], ...]


def draw_rows(path: Path, title: str, target: tuple[str, Picture], rows: Sequence[Row]) -> None:
    """Draw the rows, the target ``(h, w, 3)`` to the left of the first. Nothing is drawn without rows."""
    if not rows:
        return
    tall, wide = tile_size(target[1].shape)
    columns = 1 + max(len(row.tiles) for row in rows)
    with style():
        page = Page(SIDE + columns * (wide + GAP), HEADER + len(rows) * (tall + CAPTION + GAP))
        page.text(SIDE, 14, title, fontsize=9, weight="bold", va="center")
        page.text(SIDE + wide / 2, HEADER - 4, f"target: {target[0]}", ha="center", va="bottom")
        page.paste(SIDE, HEADER, (tall, wide), target[1])
        for index, row in enumerate(rows):
            top = HEADER + index * (tall + CAPTION + GAP)
            label = textwrap.shorten(row.label, int(tall / CHARACTER), placeholder="...")
            page.text(SIDE - 8, top + tall / 2, label, rotation=90, ha="right", va="center")
            for column, (heading, tile) in enumerate(row.tiles, start=1):
                left = SIDE + column * (wide + GAP)
                if index == 0:
                    page.text(left + wide / 2, HEADER - 4, heading, ha="center", va="bottom")
                page.tile(left, top, (tall, wide), tile)
        page.save(path)
