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

from .look.medium import DPI, medium
from .style import GREY

NEAR = 7.0  # pixels between a mark and a name that touches it; names farther away get a line to their mark
REACHES = (NEAR, 14.0, 24.0, 38.0, 56.0, 80.0)
DIRECTIONS = 16
# What a square pixel of something covered, or of a name outside the axes, costs in pixels of distance.
COVERED, OUTSIDE = 4.0, 50.0
# What a name costs that stands nearer to another mark than to its own, and the room between two names [pixels].
AMBIGUOUS, ROOM = 60.0, 8.0
RIGHT = 0.3  # of the width of a figure, for names to the right of the axes
CROWDED = 16.0  # pixels between two marks, below which each name has a line to its mark

Point = tuple[float, float]


@dataclass
class Names:
    """Places names in the pixels of axes whose limits and layout are final.

    taken: boxes in pixels that names should not cover; whatever is placed is added. marks: what is named, in pixels.
    """

    axes: Axes
    taken: list[Bbox] = field(default_factory=list)
    marks: list[Point] = field(default_factory=list)

    def pixel(self, x: float, y: float) -> Point:
        """Data coordinates in pixels."""
        across, up = self.axes.transData.transform((x, y))
        return float(across), float(up)

    def keep_clear_mark(self, x: float, y: float, size: float) -> None:
        """Keep names off a mark of ``size`` pixels in data coordinates, and from seeming to belong to it."""
        self.marks.append(self.pixel(x, y))
        self.taken.append(_box(self.marks[-1], size, size))

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
        covers = self._costs(width + ROOM, height + ROOM)
        others = np.array([mark for mark in self.marks if mark != at]).reshape(-1, 2)

        def cost(option: tuple[float, Point]) -> float:
            return covers(option) + AMBIGUOUS * bool(
                (_distances(_box(option[1], width, height), others) < option[0]).any()
            )

        reach, middle = min(_around(at, width, height), key=cost)
        self._settle(annotation, middle, width, height)
        crowd = np.hypot(*(others - at).T) if len(others) else np.array([])
        if reach > NEAR or (crowd < CROWDED).any():
            edge = _nearest(at, _box(middle, width, height))
            line = self.axes.annotate(
                "",
                xy=self._share(at),
                xytext=self._share(edge),
                xycoords="figure fraction",
                textcoords="figure fraction",
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
            xycoords="figure fraction",
            ha="center",
            va="center",
            fontsize=medium().note,
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
        annotation.set_position(self._share(middle))
        annotation.xy = self._share(middle)
        self.taken.append(_box(middle, width, height))

    def _share(self, place: Point) -> Point:
        """Pixels as shares of the figure: PDF and SVG have pixels of another size."""
        across, up = self.axes.figure.transFigure.inverted().transform(place)
        return float(across), float(up)

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


def at_right(axes: Axes, ends: Sequence[tuple[str, float]], height: float) -> None:
    """Name curves to the right of axes, each at the height of its end, pushed apart where names would overlap.

    ends: (name, height of the end in data coordinates); height: of the axes, about, in pixels.
    """
    low, high = axes.get_ylim()
    line = (high - low) * 1.35 * medium().note * DPI / 72 / height
    ordered = sorted(ends, key=lambda end: end[1])
    places = spaced([value for _, value in ordered], line, low, high)
    for (name, value), place in zip(ordered, places, strict=True):
        most = medium().characters(RIGHT * medium().width)
        words = name if len(name) <= most else f"{name[: most - 3]}..."
        axes.annotate(
            words,
            (1, value),
            (1.03, place),
            xycoords=axes.get_yaxis_transform(),
            textcoords=axes.get_yaxis_transform(),
            va="center",
            fontsize=medium().note,
            annotation_clip=False,
            parse_math=False,
            arrowprops={"arrowstyle": "-", "color": GREY, "linewidth": 0.6, "shrinkA": 0, "shrinkB": 0},
        )


def spaced(values: Sequence[float], step: float, low: float, high: float) -> list[float]:
    """Rising values moved apart to at least ``step``, as little as that takes, and off the ends while there is room."""
    # Isotonic: neighbours that collide become a block around the mean of what its members want.
    blocks: list[list[float]] = []  # of values less their shares of the steps
    for index, value in enumerate(values):
        blocks.append([value - index * step])
        while len(blocks) > 1 and np.mean(blocks[-2]) >= np.mean(blocks[-1]):
            blocks[-2:] = [blocks[-2] + blocks[-1]]
    starts = [float(np.mean(block)) for block in blocks for _ in block]
    last = high - (len(values) - 1) * step
    return [min(max(start, low), max(low, last)) + index * step for index, start in enumerate(starts)]


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


def _distances(box: Bbox, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """From a box to ``(N, 2)`` points, zero inside."""
    across = np.maximum(np.maximum(box.x0 - points[:, 0], points[:, 0] - box.x1), 0)
    up = np.maximum(np.maximum(box.y0 - points[:, 1], points[:, 1] - box.y1), 0)
    distances: NDArray[np.float64] = np.hypot(across, up)
    return distances


def _nearest(at: Point, box: Bbox) -> Point:
    """The point of a box that is nearest to a place."""
    return float(np.clip(at[0], box.x0, box.x1)), float(np.clip(at[1], box.y0, box.y1))
