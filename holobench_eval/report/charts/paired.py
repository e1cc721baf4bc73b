"""Differences to the baseline: a dot a target or a display, the mean with its interval, a line at zero."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..results import Results
from ..statistics import Array, Estimate
from .look import GREY, Look, grid, legend_below, looks, medium, note, slugs, stacked

ROW, LINE, FRAME = 27, 16, 62  # pixels: of a method, of a line of text, of a panel's title and axis
BAND = 22  # pixels: of a method's dots where its name stands above them
SPREAD = 0.3  # of a row to either side of its middle: targets keep their place in it from row to row
DOT, FEW = 9, 12  # size of a target's dot [square points], twice that for so few targets
NAMES, ABOVE = 0.28, 0.55  # of the width, for the names of the methods: beside the rows, and above narrow ones


@dataclass(frozen=True)
class Row:
    """A method: its name with marks, its ``(targets,)`` values (NaN: none), and their mean."""

    name: str
    values: Array
    estimate: Estimate
    look: Look


def displays(results: Results) -> list[tuple[str, str]]:
    """The displays that have a difference to draw, each with a name for its file."""
    slugged = slugs(results.conditions).items()
    return [(condition, stem) for condition, stem in slugged if any(_rows(results, condition))]


def draw(results: Results, condition: str, path: Path) -> str:
    """Draw the differences on one of ``displays``, best method first; the caption.

    Intervals are those of the paired tests, over clusters of targets (``data.statistics``). The dashed line is the
    constant image, at its mean difference to the baseline.
    """
    baseline, score = results.baseline, results.headline
    assert baseline is not None
    floor = results.floor(condition, less=results.values(baseline, condition))
    lines = {} if floor is None else {"floor: a constant image": floor}
    rows = sorted(_rows(results, condition), key=lambda row: row.estimate.mean, reverse=score.higher_is_better)
    draw_rows(results, path, condition, rows, lines)
    return (
        f"{score.axis}{results.text.axis}, on {condition}: differences to the baseline {baseline}. Small dots: "
        "targets, at the same height in every row; marks and bars: means and their 95 % intervals over clusters of "
        "targets, not adjusted for the number of comparisons."
    )


def _rows(results: Results, condition: str) -> Iterator[Row]:
    """A row for every method but the baseline; how many targets have no difference stands in its name."""
    looked = looks(results.names)
    for test in results.tests.values() if results.baseline else ():
        if test.condition == condition and test.estimate.n:
            name, count = results.facts.marked(test.second), len(results.targets)
            holes = f", {test.estimate.n} of {count} targets" if test.estimate.n < count else ""
            yield Row(f"{name}{holes}", test.differences, test.estimate, looked[test.second])


def draw_rows(results: Results, path: Path, title: str, rows: Sequence[Row], lines: Mapping[str, float]) -> None:
    """Rows of differences from above to below, with names and numbers; zero is the baseline, further lines are dashed.

    Names stand beside the rows, and above the dots where the figure is narrow.
    """
    baseline, score, narrow, width = results.baseline, results.headline, medium().narrow, medium().width
    better = "right" if score.higher_is_better else "left"
    axis = f"difference to {baseline} in {score.axis}{results.text.axis}; better: to the {better}"
    axis = medium().wrap(axis, (0.9 if narrow else 0.6) * width)
    labels = [f"baseline: {baseline}"]
    labels += [f"{label}, {score.with_unit(value, signed=True)}" for label, value in lines.items()]
    labels = [medium().wrap(label, 0.8 * width) for label in labels]
    names = [
        row.name if medium().height else medium().wrap(row.name, (ABOVE if narrow else NAMES) * width) for row in rows
    ]
    tall = [LINE * _lines(name) for name in names]
    unit = BAND if narrow else max(ROW, *tall)
    heights = [unit + each * narrow for each in tall]
    ends = np.cumsum(heights) / unit - 0.5
    footer = LINE * (_lines(axis) + sum(map(_lines, labels)))
    for axes in stacked(path, [title], [FRAME + sum(heights)], footer, axis):
        for row, name, at in zip(rows, names, ends - 0.5, strict=True):
            offsets = np.linspace(-SPREAD, SPREAD, max(2, len(row.values)))[: len(row.values)]
            size, mean = DOT if len(row.values) > FEW else 2 * DOT, row.estimate.mean
            axes.scatter(row.values, at + offsets, s=size, color=row.look.colour, alpha=0.4, linewidth=0, zorder=2)
            bar: dict[str, Any] = {"fmt": "none", "ecolor": "black", "elinewidth": 1.3, "capsize": 3, "zorder": 4}
            axes.errorbar(mean, at, xerr=row.estimate.reach, **bar)
            axes.plot(mean, at, **row.look.marks(7), markeredgewidth=1, zorder=5)
            end = {"xytext": (6, 0), "xycoords": axes.get_yaxis_transform(), "annotation_clip": False}
            number = score.estimate(row.estimate, signed=True)
            if narrow:
                white = {"facecolor": "white", "edgecolor": "none", "pad": 0}
                above = end | {"xytext": (0, 2), "va": "bottom", "bbox": white}
                note(axes, name, (0, at - SPREAD), **above)
                note(axes, number, (1, at - SPREAD), **above, ha="right")
            else:
                note(axes, number, (1, at), **end)
        beside = [""] * len(rows) if narrow else names
        axes.set_yticks(ends - 0.5, beside, parse_math=False, fontsize=medium().note)
        axes.set_ylim(ends[-1], -0.5)
        axes.tick_params(axis="y", length=0)
        axes.spines["left"].set_visible(False)
        grid(axes, "x")
        axes.axvline(0, color="black", linewidth=1, zorder=1, label=labels[0])
        for value, label in zip(lines.values(), labels[1:], strict=True):
            axes.axvline(value, color=GREY, linewidth=1.1, linestyle="--", zorder=1, label=label)
        axes.set_xlabel(axis, parse_math=False)
        figure = axes.get_figure(root=True)
        assert figure is not None
        legend_below(figure, *axes.get_legend_handles_labels())


def _lines(words: str) -> int:
    return words.count("\n") + 1
