"""The table, the plot and the row of pictures that the answer rests on."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..answers import budget, kind_of
from ..answers.kind import subjects
from ..charts import paired
from ..charts.curves import draw_costs
from ..charts.error_budget import draw_budgets
from ..charts.family import draw_map
from ..charts.look import looks
from ..charts.tiles import draw_rows
from ..data import over_displays
from ..data.board import board
from ..data.error_budget import budgets
from ..data.results import Results
from ..section import Blocks, Figures, Report, Section

PICTURES = "answer-pictures.jpg"
MOST_METHODS = 5  # in the map
MOST_TILES = 6  # in the row of pictures, beside the target


def _table(report: Report, _: Figures) -> Blocks:
    yield kind_of(report.results).table(board(report.results))


def _plot(report: Report) -> Iterator[tuple[Path, str]]:
    """Differences to the baseline over many displays, or else on the first display that has any."""
    if over_displays.applies(report.results) and over_displays.shown_on(report.results):
        path = report.figures / "quality-displays.png"
        yield path, paired.draw_over_displays(report.results, path)
        yield from _map(report)
        return
    yield from _paired(report, slice(1))


def _other_plots(report: Report) -> Iterator[tuple[Path, str]]:
    """The differences on the displays after the first."""
    if not over_displays.is_many(report.results):
        yield from _paired(report, slice(1, None))


def _paired(report: Report, some: slice) -> Iterator[tuple[Path, str]]:
    """The differences on some of the displays that have any."""
    for condition, stem in paired.displays(report.results)[some]:
        path = report.figures / f"quality-paired-{stem}.png"
        yield path, paired.draw(report.results, condition, path)


def _map(report: Report) -> Iterator[tuple[Path, str]]:
    """Margins against what an error budget of the displays found, of the best methods and those of the question."""
    results = report.results
    if found := over_displays.display_map(results):
        wanted = [*subjects(results), *(label for label in found.labels[1:] if label not in subjects(results))]
        looked, path = looks(results.names), report.figures / "quality-map.png"
        axis = f"difference to {results.layout.baseline} in {results.headline.axis}"
        draw_map(path, found, axis, {label: looked[label] for label in wanted[:MOST_METHODS]})
        yield (
            path,
            f"Differences to {results.layout.baseline}, a mark a display, against two parts of its error, as error "
            "budgets of the displays found them. Lines: least squares, for the eye.",
        )


def _stages(report: Report) -> Iterator[tuple[Path, str]]:
    """Pictures of the bench's stages, drawn before the report, where they are."""
    for name in dict.fromkeys(report.results.frame["display"]):
        path = report.figures / f"stages-{name}.png"
        if path.is_file():
            yield path, f"Stages of the simulated bench {name}."


def _pictures(report: Report) -> Iterator[tuple[Path, str]]:
    """A target, and its captures by the methods that are ``chosen``."""
    results, thumbnails = report.results, report.thumbnails
    condition = next((name for name in results.conditions if results.has_pictures(name)), None)
    if condition is None or not thumbnails.targets(condition):
        return
    target = thumbnails.middle(condition)
    labels = chosen(results, condition)
    tiles = [(report.layout.marked(label), thumbnails.tile(label, condition, target)) for label in labels]
    if any(tile.picture is not None for _, tile in tiles):
        path, text = report.figures / PICTURES, report.layout.text
        middle = ", the target in the middle of the ranking by quality" if len(results.targets) > 1 else ""
        draw_rows(path, f"{condition}", (target, thumbnails.targets(condition)[target]), [("", tiles)])
        yield (
            path,
            f"{text.scored.capitalize()}s of {target}{middle}, on {condition}. {text.picture}. Left: the {text.truth}.",
        )


def chosen(results: Results, condition: str) -> list[str]:
    """All methods where they are few; else the best of each group, those of the question, and the baseline."""
    display = next(each for each in board(results).displays if each.name == condition)
    everybody = [row.label for row in display.rows]
    if len(everybody) <= MOST_TILES:
        return everybody
    firsts = [rows[0].label for _, rows in display.groups]
    wanted = dict.fromkeys([*firsts, *subjects(results), str(results.layout.baseline)])
    return [label for label in everybody if label in wanted]


def _has_scores(report: Report) -> bool:
    values = report.results.table.get(report.results.headline.column)
    return bool(report.results.conditions) and values is not None and bool(np.isfinite(values).any())


def _budgets(report: Report) -> Iterator[tuple[Path, str]]:
    """Where the error of captures comes from."""
    if found := budgets(report.results):
        path = report.figures / "error-budget.png"
        draw_budgets(path, found)
        yield (
            path,
            "The error budget. Left: parts of the squared error of the captures, by display, with their PSNR. Right: "
            "what removing a part and all parts to its left would gain at most, with its 95 % interval over clusters; "
            "for temporal noise, what captures with no other error would gain.",
        )


def _spends(results: Results) -> bool:
    known = results.layout.spends_captures and not results.layout.predicts and "total_captures" in results.table
    return known and not over_displays.is_many(results) and bool((results.table["total_captures"] > 0).any())


def _is_budget(report: Report) -> bool:
    return _spends(report.results) and kind_of(report.results) is budget.KIND


def _costs(report: Report) -> Iterator[tuple[Path, str]]:
    """Quality against the photographs that it cost."""
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
    Section("overview", 3, _table, applies=_has_scores),
    Section(
        "plot", 4, applies=lambda report: _has_scores(report) and report.layout.measure != "error_budget", figures=_plot
    ),
    Section("error budget", 5, figures=_budgets),
    Section(
        "pictures", 6, applies=_has_scores, figures=lambda report: report.pictures(PICTURES, lambda: _pictures(report))
    ),
    Section("other plots", 30, applies=_has_scores, figures=_other_plots, details=True),
    Section("stages", 90, figures=_stages, details=True),
    Section("budget, drawn", 44, applies=_is_budget, figures=_costs),
    Section(
        "cost",
        40,
        applies=lambda report: _spends(report.results) and not _is_budget(report) and not report.results.done.empty,
        figures=_costs,
        details=True,
    ),
)
