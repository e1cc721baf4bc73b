"""Quality against the photographs that it cost."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from ..answers import budget, kind_of
from ..charts.cost import draw_costs
from ..charts.look.methods import looks
from ..data.board import board
from ..data.over_displays import is_many
from ..data.results import Results
from ..section import Report, Section


def _spends(results: Results) -> bool:
    known = results.layout.spends_captures and not results.layout.predicts and "total_captures" in results.table
    return known and not is_many(results) and bool((results.table["total_captures"] > 0).any())


def _is_budget(report: Report) -> bool:
    return _spends(report.results) and kind_of(report.results) is budget.KIND


def _figures(report: Report) -> Iterator[tuple[Path, str]]:
    results, path = report.results, report.figures / "quality-captures.png"
    axis = f"{results.headline.axis}{results.layout.text.axis}"
    displays = [each for each in board(results).displays if any(row.photographs for row in each.rows)]
    draw_costs(path, displays, results.names, looks(results.names), axis)
    yield (
        path,
        f"{axis}, against all photographs of a row: those of its training once, and those of every target. Lines join "
        "the rows of a method. Bars: 95 % interval of the difference to the baseline.",
    )


SECTIONS = (
    Section("budget, drawn", 44, applies=_is_budget, figures=_figures),
    Section(
        "cost",
        40,
        applies=lambda report: _spends(report.results) and not _is_budget(report) and not report.results.done.empty,
        figures=_figures,
        details=True,
    ),
)
