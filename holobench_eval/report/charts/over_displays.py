"""Margins over the baseline, display by display: a dot a display, the mean with its interval, a line at zero."""

from __future__ import annotations

from pathlib import Path

from ..data.over_displays import margins, published, shown_on
from ..data.results import Results
from .look.medium import medium
from .look.methods import looks
from .quality import Row, draw_rows_of_dots, footer_of, height_of
from .style import GREY, save, stacked, style


def draw(results: Results, path: Path) -> None:
    """Draw a row for every method, best first; dashed: margins that were published, of the methods that have one."""
    score, layout, looked = results.headline, results.layout, looks(results.names)
    rows = [
        Row(each.label, each.values, each.over_both, looked[each.label], score.estimate(each.over_both, signed=True))
        for each in margins(results)
    ]
    axis = f"difference to {layout.baseline} in {score.axis}, mean over targets"
    labels = [f"baseline: {layout.baseline}"]
    margins_published = {row.name: found for row in rows if (found := published(results, row.name)) is not None}
    labels += [
        f"published for {label}: {score.with_unit(value, signed=True)}" for label, value in margins_published.items()
    ]
    with style():
        figure, (axes,) = stacked(
            [f"{len(shown_on(results))} displays"],
            [height_of(rows)],
            footer_of(medium().wrap(axis, 0.6 * medium().width), labels),
        )
        draw_rows_of_dots(axes, rows)
        axes.axvline(0, color="black", linewidth=1, zorder=1, label=labels[0])
        for value, label in zip(margins_published.values(), labels[1:], strict=True):
            axes.axvline(value, color=GREY, linewidth=1.1, linestyle="--", zorder=1, label=label)
        axes.set_xlabel(axis, parse_math=False)
        legend = figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", frameon=False)
        for text in legend.get_texts():
            text.set_parse_math(False)
        save(figure, path)


def caption(results: Results) -> str:
    """What the chart shows."""
    return (
        f"Differences to {results.layout.baseline} in {results.headline.axis}. Small dots: displays, at the same "
        "height in every row; marks and bars: means and their 95 % intervals over displays and clusters of targets."
    )
