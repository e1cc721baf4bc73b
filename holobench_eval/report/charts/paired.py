"""Differences to the baseline: a dot a target or a display, the mean with its interval, a line at zero."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from ..data import over_displays
from ..data.results import Results
from .look.medium import medium
from .look.methods import looks
from .quality import Row, best_first, draw_rows_of_dots, footer_of, height_of
from .style import GREY, legend_below, save, slugs, stacked, style


def displays(results: Results) -> list[tuple[str, str]]:
    """The displays that have a difference to draw, each with a name for its file."""
    slugged = slugs(results.conditions).items()
    return [(condition, stem) for condition, stem in slugged if any(_rows(results, condition))]


def draw(results: Results, condition: str, path: Path) -> None:
    """Draw the differences on one of ``displays``, best method first.

    Intervals are those of the paired tests, over clusters of targets (``data.statistics``). The dashed line is the
    constant image, at its mean difference to the baseline.
    """
    baseline, score = results.layout.baseline, results.headline
    assert baseline is not None
    above = results.above_floor(baseline, condition)
    lines = {} if above is None else {"floor: a constant image": -above.mean}
    rows = best_first(_rows(results, condition), score.higher_is_better)
    _draw(results, path, condition, rows, lines)


def draw_over_displays(results: Results, path: Path) -> None:
    """Draw the mean differences of each display, best method first; dashed: differences that were published."""
    score, looked, found = results.headline, looks(results.names), over_displays.margins(results)
    rows = [
        Row(each.label, each.values, each.over_both, looked[each.label], score.estimate(each.over_both, signed=True))
        for each in found
    ]
    known = {f"published for {each.label}": over_displays.published(results, each.label) for each in found}
    lines = {label: value for label, value in known.items() if value is not None}
    _draw(results, path, f"{len(over_displays.shown_on(results))} displays", rows, lines)


def _draw(results: Results, path: Path, title: str, rows: Sequence[Row], lines: Mapping[str, float]) -> None:
    """Rows of differences to the baseline, which is a line at zero; further lines are dashed."""
    baseline, score = results.layout.baseline, results.headline
    better = "right" if score.higher_is_better else "left"
    axis = f"difference to {baseline} in {score.axis}{results.layout.text.axis}; better: to the {better}"
    axis = medium().wrap(axis, 0.6 * medium().width)
    labels = [f"baseline: {baseline}"]
    labels += [f"{label}, {score.with_unit(value, signed=True)}" for label, value in lines.items()]
    labels = [medium().wrap(label, 0.8 * medium().width) for label in labels]
    with style():
        figure, (axes,) = stacked([title], [height_of(rows)], footer_of(axis, labels))
        draw_rows_of_dots(axes, rows)
        axes.axvline(0, color="black", linewidth=1, zorder=1, label=labels[0])
        for value, label in zip(lines.values(), labels[1:], strict=True):
            axes.axvline(value, color=GREY, linewidth=1.1, linestyle="--", zorder=1, label=label)
        axes.set_xlabel(axis, parse_math=False)
        legend_below(figure, *axes.get_legend_handles_labels())
        save(figure, path)


def caption_over_displays(results: Results) -> str:
    """What the chart over displays shows."""
    return (
        f"Differences to {results.layout.baseline} in {results.headline.axis}. Small dots: displays, at the same "
        "height in every row; marks and bars: means and their 95 % intervals over displays and clusters of targets."
    )


def caption(results: Results, condition: str) -> str:
    """What the chart of a display shows."""
    return (
        f"{results.headline.axis}{results.layout.text.axis}, on {condition}: differences to the baseline "
        f"{results.layout.baseline}. Small dots: targets, at the same height in every row; marks and bars: means and "
        "their 95 % intervals over clusters of targets, not adjusted for the number of comparisons."
    )


def _rows(results: Results, condition: str) -> Iterator[Row]:
    """A row for every method but the baseline; how many targets have no difference stands in its name."""
    looked, score = looks(results.names), results.headline
    for test in results.against_baseline if results.layout.baseline else ():
        if test.condition != condition or not test.estimate.n:
            continue
        name = results.layout.marked(test.second)
        if test.estimate.n < len(results.targets):
            name = f"{name}, {test.estimate.n} of {len(results.targets)} targets"
        yield Row(
            name, test.differences, test.estimate, looked[test.second], score.estimate(test.estimate, signed=True)
        )
