"""Names beside the marks of a chart: each where it covers least, so that no legend need be looked up."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from matplotlib.axes import Axes
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

from .style import GREY

FONT = 8
NEAR = 7.0  # pixels between a mark and a name that touches it; names farther away get a line to their mark
REACHES = (NEAR, 14.0, 24.0, 38.0, 56.0, 80.0)
DIRECTIONS = 16
# What a square pixel of something covered, or of a name outside the axes, costs in pixels of distance.
COVERED, OUTSIDE = 4.0, 50.0

Point = tuple[float, float]


@dataclass
class Names:
    """Places names in the pixels of axes whose limits and layout are final.

    taken: boxes in pixels that names should not cover; whatever is placed is added.
    """

    axes: Axes
    taken: list[Bbox] = field(default_factory=list)

    def pixel(self, x: float, y: float) -> Point:
        """Data coordinates in pixels."""
        across, up = self.axes.transData.transform((x, y))
        return float(across), float(up)

    def keep_clear(self, x: float, y: float, size: float) -> None:
        """Keep names off a square of ``size`` pixels around a place in data coordinates."""
        self.taken.append(_box(self.pixel(x, y), size, size))

    def keep_clear_line(self, points: Sequence[Point], width: float = 3.0, step: float = 6.0) -> None:
        """Keep names off a line through places in data coordinates."""
        for start, end in itertools.pairwise(self.pixel(*point) for point in points):
            count = max(2, int(math.dist(start, end) / step))
            for share in np.linspace(0, 1, count):
                middle = tuple(a + share * (b - a) for a, b in zip(start, end, strict=True))
                self.taken.append(_box((middle[0], middle[1]), width, width))

    def beside(self, text: str, x: float, y: float) -> None:
        """Name a mark: as near as nothing is covered, with a line to the mark where that is far."""
        at = self.pixel(x, y)
        annotation = self._write(text)
        width, height = self._size(annotation)
        cost = self._costs(width, height)
        reach, middle = min(_around(at, width, height), key=cost)
        self._settle(annotation, middle, width, height)
        if reach > NEAR:
            edge = _nearest(at, _box(middle, width, height))
            line = self.axes.annotate(
                "",
                xy=at,
                xytext=edge,
                xycoords="figure pixels",
                textcoords="figure pixels",
                arrowprops={"arrowstyle": "-", "color": GREY, "linewidth": 0.6, "shrinkA": 0, "shrinkB": 4},
            )
            line.set_in_layout(False)

    def along(self, text: str, y: float) -> None:
        """Name a horizontal line, above or below it, where nothing is covered."""
        annotation = self._write(text)
        width, height = self._size(annotation)
        frame, level = self.axes.bbox, self.pixel(self.axes.get_xlim()[0], y)[1]
        room = frame.width - width - 8
        options = [
            (
                0.0 if above else 2.0,
                (frame.x0 + 4 + width / 2 + share * room, level + (1 if above else -1) * height * 0.7),
            )
            for share in (1.0, 0.75, 0.5, 0.25, 0.0)
            for above in (True, False)
        ]
        _, middle = min(options, key=self._costs(width, height))
        self._settle(annotation, middle, width, height)

    def _write(self, text: str) -> Annotation:
        annotation = self.axes.annotate(
            text,
            xy=(0, 0),
            xycoords="figure pixels",
            ha="center",
            va="center",
            fontsize=FONT,
            parse_math=False,
            annotation_clip=False,
            zorder=6,
        )
        annotation.set_in_layout(False)
        return annotation

    def _size(self, annotation: Annotation) -> tuple[float, float]:
        box = annotation.get_window_extent()
        return float(box.width) + 2, float(box.height) + 1

    def _settle(self, annotation: Annotation, middle: Point, width: float, height: float) -> None:
        annotation.set_position(middle)
        annotation.xy = middle
        self.taken.append(_box(middle, width, height))

    def _costs(self, width: float, height: float) -> Callable[[tuple[float, Point]], float]:
        """What a box of that size costs at a (reach, middle), as things stand."""
        taken = np.array([box.extents for box in self.taken]).reshape(-1, 4)
        frame = np.array([self.axes.bbox.extents])

        def cost(option: tuple[float, Point]) -> float:
            reach, (x, y) = option
            box = np.array([x - width / 2, y - height / 2, x + width / 2, y + height / 2])
            outside = width * height - _shared(box, frame)
            return COVERED * _shared(box, taken) + OUTSIDE * outside + reach

        return cost


def _around(at: Point, width: float, height: float) -> Iterator[tuple[float, Point]]:
    """(distance, middle) of boxes around a place, nearest first; the distance is from the place to the box's edge."""
    for reach in REACHES:
        for index in range(DIRECTIONS):
            angle = 2 * math.pi * index / DIRECTIONS
            across, up = math.cos(angle), math.sin(angle)
            yield reach, (at[0] + across * (reach + width / 2), at[1] + up * (reach + height / 2))


def _box(middle: Point, width: float, height: float) -> Bbox:
    x, y = middle
    return Bbox.from_extents(x - width / 2, y - height / 2, x + width / 2, y + height / 2)


def _shared(box: NDArray[np.float64], others: NDArray[np.float64]) -> float:
    """Area that a box shares with others, ``(N, 4)`` as x0, y0, x1, y1."""
    size = np.minimum(box[2:], others[:, 2:]) - np.maximum(box[:2], others[:, :2])
    return float(size.clip(min=0).prod(axis=1).sum())


def _nearest(at: Point, box: Bbox) -> Point:
    """The point of a box that is nearest to a place."""
    return float(np.clip(at[0], box.x0, box.x1)), float(np.clip(at[1], box.y0, box.y1))
