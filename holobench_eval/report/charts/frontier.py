"""Charts of quality against what it cost: captures of the camera, or seconds.

One panel per display. The baseline is a horizontal line, what a camera must be worth; the privileged method and the
constant image are others. Marks are named where they stand, and the rows of one method that differ in their captures
are joined. Pale steps show the best quality for a cost, apart for methods with and without the camera for the scored
image.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter

from ..data.categories import OFFLINE, ONLINE
from .labels import CROWDED, Names
from .look.medium import medium
from .look.methods import Look
from .style import PALE, grid, save, stacked, style

PANEL = 370
FOOTER = 20
# Widths relative to that of the logarithmic part: between zero and the smallest cost, and between marks without any
# cost, which stand side by side so that none hides another.
ZERO_GAP = 0.14
SPREAD = 0.02
APART = 0.07  # two ticks with names, the same
# From so many rows of a method on, no two with the same captures, they are a curve, named at its end; fewer, or rows
# that differ in something else, are marks of their own.
SHORTEST_CURVE = 3
MOST_CROWDED = 3  # rows of one method that stand side by side and have names each; of more, their number is named


@dataclass(frozen=True)
class Mark:
    """A row of the study: ``cost`` along the axis, mean quality and its interval (NaN: none).

    group: the registered method; captures: all of the row; category: whether it competes for a frontier with others.
    """

    label: str
    group: str
    category: str
    cost: float
    quality: float
    low: float
    high: float
    captures: float


@dataclass(frozen=True)
class Line:
    """A horizontal line with its name; ``low`` and ``high`` bound its band (NaN: none)."""

    label: str
    quality: float
    low: float = float("nan")
    high: float = float("nan")


@dataclass(frozen=True)
class Frontier:
    """A panel: the marks of a display, and the lines they are compared with; higher: whether more quality is better."""

    condition: str
    marks: tuple[Mark, ...]
    higher: bool = True
    baseline: Line | None = None
    oracle: Line | None = None
    constant: Line | None = None

    @property
    def lines(self) -> list[tuple[Line, tuple[float, float]]]:
        """The horizontal lines that there are, with their dashes."""
        lines = ((self.baseline, (6, 3)), (self.oracle, (1.5, 2)), (self.constant, (3, 3)))
        return [(line, dashes) for line, dashes in lines if line is not None]


@dataclass(frozen=True)
class Costs:
    """The axis of costs, equal in all panels: positions are decimal logarithms, and zero has a position of its own.

    low, high: ends of the logarithmic part; free: labels of marks without any cost, side by side around ``zero``;
    own: logarithms of the marks' costs, where these are apart enough to be ticks.
    """

    low: float
    high: float
    free: tuple[str, ...] = ()
    own: tuple[float, ...] = ()

    @classmethod
    def of(cls, marks: Sequence[Mark]) -> Costs:
        """The axis for some marks, at least one of them with a cost above zero."""
        logs = np.log10([mark.cost for mark in marks if mark.cost > 0])
        left, right = (max(0.12, share * float(np.ptp(logs))) for share in (0.06, 0.16))  # to the right stand names
        free = tuple(dict.fromkeys(mark.label for mark in marks if mark.cost == 0))
        low, high, own = float(logs.min()) - left, float(logs.max()) + right, np.unique(logs)
        return cls(low, high, free, tuple(own) if (np.diff(own) > APART * (high - low)).all() else ())

    @property
    def width(self) -> float:
        """Of the logarithmic part."""
        return self.high - self.low

    @property
    def half(self) -> float:
        """Half of what the marks without any cost spread over."""
        return SPREAD * self.width * (len(self.free) - 1) / 2

    @property
    def zero(self) -> float | None:
        """The position of zero; None where every mark has a cost."""
        return self.low - ZERO_GAP * self.width - self.half if self.free else None

    def position(self, mark: Mark) -> float:
        """Where a mark stands."""
        if mark.cost > 0 or self.zero is None:
            return float(np.log10(mark.cost))
        return self.zero - self.half + SPREAD * self.width * self.free.index(mark.label)

    @property
    def limits(self) -> tuple[float, float]:
        """Ends of the axis."""
        return (self.low if self.zero is None else self.zero - self.half - 0.08 * self.width), self.high

    def show(self, axes: Axes) -> None:
        """Ticks at decades, and at 2 and 5 in between where there are few; at the marks where that leaves one at most;
        zero with a break of the axis."""
        decades = range(int(np.floor(self.low)), int(np.ceil(self.high)) + 1)
        named = (1, 2, 5) if self.width < 2.5 else (1,)
        ticks = [exponent + float(np.log10(step)) for exponent in decades for step in named]
        small = [exponent + float(np.log10(step)) for exponent in decades for step in range(2, 10)]
        inside = [tick for tick in ticks if self.low <= tick <= self.high]
        inside = inside if len(inside) > 1 else [*(self.own or inside)]
        axes.set_xlim(*self.limits)
        axes.xaxis.set_major_locator(FixedLocator(inside if self.zero is None else [self.zero, *inside]))
        axes.xaxis.set_minor_locator(FixedLocator([tick for tick in small if self.low <= tick <= self.high]))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda position, _: self._name(position)))
        axes.xaxis.set_minor_formatter(NullFormatter())
        if self.zero is not None:
            _break(axes, self.low - ZERO_GAP * self.width / 2)

    def _name(self, position: float) -> str:
        cost = 10**position
        return "0" if position == self.zero else f"{cost:,.0f}" if cost > 99 else f"{cost:.2g}"


def _break(axes: Axes, position: float) -> None:
    """Two strokes across the lower spine: the axis is not to scale here."""
    transform = axes.get_xaxis_transform()
    gap = 0.006 * (axes.get_xlim()[1] - axes.get_xlim()[0])
    axes.plot([position - gap, position + gap], [0, 0], color="white", linewidth=3, clip_on=False, transform=transform)
    for side in (-gap, gap):
        axes.plot(
            [position + side],
            [0],
            marker=[(-0.5, -1), (0.5, 1)],
            markersize=10,
            color="black",
            clip_on=False,
            transform=transform,
            zorder=5,
        )


def draw_frontiers(path: Path, panels: Sequence[Frontier], axis: str, cost: str, looked: Mapping[str, Look]) -> None:
    """Draw a panel per display.

    axis: name of the quality with its unit; cost: of what it is drawn against, with its unit; looked: the look of every
    label.
    """
    costs = Costs.of([mark for panel in panels for mark in panel.marks])
    with style():
        figure, drawn = stacked([panel.condition for panel in panels], [PANEL] * len(panels), FOOTER)
        for axes, panel in zip(drawn, panels, strict=True):
            _draw_frontier(axes, panel, costs, looked)
            axes.set_ylabel(axis.replace(", of ", "\nof "))
        drawn[-1].set_xlabel(medium().wrap(cost, 0.85 * medium().width))
        figure.draw_without_rendering()
        figure.set_layout_engine("none")  # names are placed by the pixel, so that nothing may move any more
        for axes, panel in zip(drawn, panels, strict=True):
            _name_all(axes, panel, costs)
        save(figure, path)


def _groups(panel: Frontier) -> list[list[Mark]]:
    """The marks of each registered method, by their costs."""
    groups = dict.fromkeys(mark.group for mark in panel.marks)
    return [sorted((m for m in panel.marks if m.group == group), key=lambda m: m.cost) for group in groups]


def _is_curve(marks: Sequence[Mark]) -> bool:
    """Whether the rows of a method are its quality at several budgets."""
    return len({mark.captures for mark in marks}) == len(marks) >= SHORTEST_CURVE


def _front(panel: Frontier, categories: Sequence[str], costs: Costs) -> list[tuple[float, float]]:
    """Corners of the steps that the best of some categories make: the quality that is to be had for a cost."""
    sign = 1 if panel.higher else -1
    corners: list[tuple[float, float]] = []
    for mark in sorted((m for m in panel.marks if m.category in categories), key=lambda m: (m.cost, -sign * m.quality)):
        best = corners[-1][1] if corners else -sign * np.inf
        if sign * mark.quality > sign * best:
            corners += [(costs.position(mark), best)] * bool(corners) + [(costs.position(mark), mark.quality)]
    return corners


def _draw_frontier(axes: Axes, panel: Frontier, costs: Costs, looked: Mapping[str, Look]) -> None:
    for line, dashes in panel.lines:
        axes.axhline(line.quality, color="black", linewidth=1.1, dashes=dashes, zorder=1)
        if np.isfinite(line.low):
            axes.axhspan(line.low, line.high, color="black", alpha=0.07, linewidth=0, zorder=0)
    for categories in (OFFLINE, (ONLINE,)):
        steps = _front(panel, categories, costs)
        axes.plot([x for x, _ in steps], [y for _, y in steps], color=PALE, linewidth=2.2, zorder=1)
    for marks in _groups(panel):
        positions = [costs.position(mark) for mark in marks]
        if _is_curve(marks):
            colour = looked[marks[0].label].colour
            axes.plot(positions, [mark.quality for mark in marks], color=colour, linewidth=1.4, zorder=2)
        for position, mark in zip(positions, marks, strict=True):
            offsets = np.nan_to_num([[mark.quality - mark.low], [mark.high - mark.quality]])
            axes.errorbar(
                position,
                mark.quality,
                yerr=offsets,
                fmt=looked[mark.label].marker,
                color=looked[mark.label].face,
                ecolor=looked[mark.label].colour,
                markersize=6.5,
                markeredgecolor=looked[mark.label].colour,
                markeredgewidth=1.0,
                elinewidth=1.0,
                capsize=2.5,
                zorder=3,
            )
    costs.show(axes)
    axes.margins(y=0.1)
    grid(axes)


def _name_all(axes: Axes, panel: Frontier, costs: Costs) -> None:
    names, groups = Names(axes), _groups(panel)
    for marks in groups:
        if _is_curve(marks):
            names.keep_clear_line([(costs.position(mark), mark.quality) for mark in marks])
        for mark in marks:
            position = costs.position(mark)
            names.keep_clear_mark(position, mark.quality, 11)
            if np.isfinite(mark.low):
                names.keep_clear_line([(position, mark.low), (position, mark.high)])
    for categories in (OFFLINE, (ONLINE,)):
        names.keep_clear_line(_front(panel, categories, costs))
    for line, _ in panel.lines:
        names.keep_clear_line([(end, line.quality) for end in axes.get_xlim()], width=2)
    for line, _ in panel.lines:
        names.along(line.label, line.quality)
    for marks in sorted(groups, key=len, reverse=True):
        last = marks[-1]
        if _is_curve(marks) and last.cost > marks[0].cost:
            names.beside(last.group.rpartition(":")[2], costs.position(last), last.quality)
            continue
        for crowd in _crowds(marks, [names.pixel(costs.position(mark), mark.quality) for mark in marks]):
            named = [(mark.label, mark) for mark in crowd]
            if len(crowd) > MOST_CROWDED:
                named = [(f"{last.group.rpartition(':')[2]}, {len(crowd)} variants", crowd[len(crowd) // 2])]
            for name, mark in named:
                names.beside(name, costs.position(mark), mark.quality)


def _crowds(marks: Sequence[Mark], pixels: Sequence[tuple[float, float]]) -> list[list[Mark]]:
    """The marks of a method in groups whose members stand side by side."""
    crowds: list[list[int]] = []
    for index, here in enumerate(pixels):
        near = [crowd for crowd in crowds if any(math.dist(here, pixels[other]) < CROWDED for other in crowd)]
        crowds = [crowd for crowd in crowds if crowd not in near] + [[*itertools.chain(*near), index]]
    return [[marks[index] for index in crowd] for crowd in crowds]
