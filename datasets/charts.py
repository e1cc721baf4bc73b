"""Test charts, drawn at the size asked for: lines, bars, a star, a ramp, a checkerboard, circles."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from ..core.errors import UserError
from ..optics import srgb_decode
from .base import chosen, known, named_digest, with_channels

VERSION = 1  # part of every digest: raise it when a chart is drawn differently

SMALLEST = 32  # shortest side [px] that a chart can be drawn on; all details are legible from 160 px on

SAMPLES = 6  # samples a pixel and axis where the covered area of a pixel has no simple closed form


def tv_lines(rows: int, columns: int) -> Tensor:
    """Patches of vertical and of horizontal lines, six line widths from one pixel to a thirtieth of the short side.

    A line width of p px is rows / p TV lines per picture height, counting bright and dark lines (the definition of
    limiting resolution in EIA-1956 charts). From the top left, the cells go from fine to coarse, three beside each
    other on a wide region and two on a tall one; each has vertical lines above or left, horizontal lines below or
    right.
    """
    across, down = (3, 2) if columns >= rows else (2, 3)
    cell_rows, cell_columns = rows // down, columns // across
    gap = max(2, min(rows, columns) // 50)
    image = torch.zeros(rows, columns, dtype=torch.float64)
    for index, width in enumerate(_line_widths(min(rows, columns) / 30, across * down)):
        top, left = index // across * cell_rows + gap, index % across * cell_columns + gap
        high, wide = cell_rows - 2 * gap, cell_columns - 2 * gap
        if high >= wide:
            patches = (top, left, high // 2 - gap, wide), (top + high // 2 + gap, left, high // 2 - gap, wide)
        else:
            patches = (top, left, high, wide // 2 - gap), (top, left + wide // 2 + gap, high, wide // 2 - gap)
        (y, x, height, length), (y2, x2, height2, length2) = patches
        image += torch.outer(_bars(y, height, 1, rows), _lines(x, length, width, columns))
        image += torch.outer(_lines(y2, height2, width, rows), _bars(x2, length2, 1, columns))
    return image


def siemens_star(rows: int, columns: int) -> Tensor:
    """36 bright spokes on black, as wide as the gaps between them, in a disc of 0.95 of the short side.

    At a radius of r px a period is 2 pi r / 36 px, so the spokes merge into gray two pixels to a period at r = 11.5.
    """

    def spokes(y: Tensor, x: Tensor) -> Tensor:
        inside = torch.hypot(y, x) < 0.475 * min(rows, columns)
        return (torch.cos(36 * torch.atan2(y, x)) > 0) & inside

    return _sampled(spokes, rows, columns)


def usaf_bars(rows: int, columns: int) -> Tensor:
    """Three groups of six three-bar elements, as on the USAF 1951 target (MIL-STD-150A), bright on black.

    A bar is five times as long as wide, an element is a square of vertical and one of horizontal bars, and the bar
    width falls by 2^(1/6) from one element to the next: the first group down the left, the second and the third
    to its right. The widest bar is 1/34 of the short side.
    """
    side = min(rows, columns)
    image = torch.zeros(rows, columns, dtype=torch.float64)
    widest = side / 34
    top = (rows - side) / 2 + widest
    left = (columns - side) / 2 + 5 * widest
    y, x = top, left
    for element in range(18):
        width = widest * 2 ** (-element / 6)
        if element == 6:
            y, x = top, left + 18 * widest
        image += torch.outer(_bars(y, 5 * width, 1, rows), _bars(x, width, 3, columns))
        image += torch.outer(_bars(y, width, 3, rows), _bars(x + 7 * width, 5 * width, 1, columns))
        y += 7 * width
    return image


def gray_ramp(rows: int, columns: int) -> Tensor:
    """Above, a smooth ramp in linear light from 0 to 1; below, twelve patches in equal steps of sRGB."""
    smooth = torch.linspace(0.0, 1.0, columns, dtype=torch.float64)
    levels = srgb_decode(torch.linspace(0.0, 1.0, 12, dtype=torch.float64))
    edges = [step * columns / 12 for step in range(13)]
    patches = sum(
        (level * _bars(edges[step], edges[step + 1] - edges[step], 1, columns) for step, level in enumerate(levels)),
        start=torch.zeros(columns, dtype=torch.float64),
    )
    above = _bars(0.0, rows / 2, 1, rows)
    return torch.outer(above, smooth) + torch.outer(1 - above, patches)


def checkerboard(rows: int, columns: int) -> Tensor:
    """Squares of an eighth of the short side, half of them bright, with a corner of four squares in the centre."""
    side = min(rows, columns) / 8

    def signs(count: int) -> Tensor:
        # Mean over a pixel of +1 on even and -1 on odd squares; the mean over the area is the product of the two.
        first = count / 2 - 2 * side * math.ceil(count / (4 * side))
        return 2 * _lines(first, count - first, side, count) - 1

    return 0.5 + 0.5 * torch.outer(signs(rows), signs(columns))


def circle_grid(rows: int, columns: int) -> Tensor:
    """Bright discs on black, an eighth of the short side apart, 0.6 of that wide, and one of them in the centre."""
    step = min(rows, columns) / 8

    def discs(y: Tensor, x: Tensor) -> Tensor:
        off_y, off_x = (torch.remainder(t / step + 0.5, 1.0) - 0.5 for t in (y, x))
        uncut = (y.abs() / step + 0.5).floor() * step + step / 2 <= rows / 2
        uncut = uncut & ((x.abs() / step + 0.5).floor() * step + step / 2 <= columns / 2)
        return (torch.hypot(off_y, off_x) < 0.3) & uncut

    return _sampled(discs, rows, columns)


CHARTS: dict[str, Callable[[int, int], Tensor]] = {
    draw.__name__: draw for draw in (tv_lines, siemens_star, usaf_bars, gray_ramp, checkerboard, circle_grid)
}


@dataclass(frozen=True)
class Charts:
    """Charts of lines, bars, spokes, gray levels, squares and circles, for resolution, tone and geometry.

    Charts are gray, in linear light from 0 to 1, the same in every channel. They are drawn for the shape asked for, not
    resized: circles stay circles and the finest lines stay one pixel wide. Edges within a pixel give the mean over its
    area.

    names: which, in which order; all by default.
    """

    names: tuple[str, ...] = tuple(CHARTS)

    training: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """UserError for an unknown or repeated name."""
        chosen("chart", self.names, tuple(CHARTS))

    def items(self) -> list[str]:
        """The names, in order."""
        return list(self.names)

    def load(self, item: str, shape: tuple[int, int], channels: int = 3) -> Tensor:
        """A chart as ``(channels, *shape)`` linear light in [0, 1]; UserError for a shape below 32 px."""
        draw = CHARTS[known("chart", item, self.names)]
        if min(shape) < SMALLEST:
            raise UserError(f"chart '{item}' needs {SMALLEST} px or more in both directions, not {shape}")
        return with_channels(draw(*shape).clamp(0.0, 1.0).float().repeat(3, 1, 1), channels)

    def digest(self, item: str) -> str:
        """SHA-256 of the chart's name and the version of the drawings."""
        return named_digest("chart", VERSION, known("chart", item, self.names))


def _line_widths(widest: float, count: int) -> list[int]:
    """Whole pixels from 1 to ``widest``, in equal ratios as far as whole pixels allow, each wider than the last."""
    widths = [1]
    for index in range(1, count):
        widths.append(max(widths[-1] + 1, round(widest ** (index / (count - 1)))))
    return widths


def _bars(start: float, width: float, count: int, size: int) -> Tensor:
    """Bars as wide as their gaps, from ``start`` on: the fraction of each of ``size`` pixels that they cover."""
    edges = torch.arange(size + 1, dtype=torch.float64)
    covered = torch.zeros(size, dtype=torch.float64)
    for bar in range(count):
        inside = edges.clamp(start + 2 * bar * width, start + (2 * bar + 1) * width)
        covered += inside[1:] - inside[:-1]
    return covered


def _lines(start: float, length: float, width: float, size: int) -> Tensor:
    """As many bars as end within ``length``."""
    return _bars(start, width, math.floor((length / width + 1) / 2), size)


def _sampled(bright: Callable[[Tensor, Tensor], Tensor], rows: int, columns: int) -> Tensor:
    """The fraction of each pixel where ``bright(y, x)``; y and x are px from the centre."""
    y = torch.arange(rows, dtype=torch.float64)[:, None] - rows / 2
    x = torch.arange(columns, dtype=torch.float64)[None, :] - columns / 2
    total = torch.zeros(rows, columns, dtype=torch.float64)
    offsets = [(step + 0.5) / SAMPLES for step in range(SAMPLES)]
    for dy in offsets:
        for dx in offsets:
            total += bright(y + dy, x + dx)
    return total / SAMPLES**2
