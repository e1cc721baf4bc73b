"""Differences to the baseline, target by target: a dot a target, the mean with its interval, a line at zero."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from ..data.results import Results
from .look.medium import medium
from .look.methods import looks
from .quality import Row, best_first, draw_rows_of_dots, footer_of, height_of
from .style import GREY, save, slugs, stacked, style


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
    rows = best_first(_rows(results, condition), score.higher_is_better)
    assert baseline is not None
    above = results.above_floor(baseline, condition)
    better = "right" if score.higher_is_better else "left"
    axis = f"difference to {baseline} in {score.axis}{results.layout.text.axis}; better: to the {better}"
    axis = medium().wrap(axis, 0.6 * medium().width)
    labels = [f"baseline: {baseline}"]
    if above is not None:
        labels.append(f"floor: a constant image, {score.with_unit(-above.mean, signed=True)}")
    labels = [medium().wrap(label, 0.8 * medium().width) for label in labels]
    with style():
        figure, (axes,) = stacked([condition], [height_of(rows)], footer_of(axis, labels))
        draw_rows_of_dots(axes, rows)
        axes.axvline(0, color="black", linewidth=1, zorder=1, label=labels[0])
        if above is not None:
            axes.axvline(-above.mean, color=GREY, linewidth=1.1, linestyle="--", zorder=1, label=labels[1])
        axes.set_xlabel(axis, parse_math=False)
        legend = figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", frameon=False)
        for text in legend.get_texts():
            text.set_parse_math(False)
        save(figure, path)


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
