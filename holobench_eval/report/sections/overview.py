"""The table, the plot and the row of pictures that the answer rests on."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..charts import paired
from ..charts.tiles import draw_rows
from ..data.board import board
from ..data.results import Results
from ..section import Blocks, Figures, Report, Section
from ..stories import comparison, many_displays, story_of
from ..story import is_many, subjects

PICTURES = "answer-pictures.jpg"
MOST_TILES = 6  # in the row of pictures, beside the target


def _table(report: Report, _: Figures) -> Blocks:
    yield getattr(story_of(report.results), "table", comparison.table)(board(report.results))


def _plot(report: Report) -> Iterator[tuple[Path, str]]:
    """Differences to the baseline on the first display that has any."""
    if not (many_displays.applies(report.results) and many_displays.shown_on(report.results)):
        yield from _paired(report, slice(1))


def _other_plots(report: Report) -> Iterator[tuple[Path, str]]:
    """The differences on the displays after the first."""
    if not is_many(report.results):
        yield from _paired(report, slice(1, None))


def _paired(report: Report, some: slice) -> Iterator[tuple[Path, str]]:
    """The differences on some of the displays that have any."""
    for condition, stem in paired.displays(report.results)[some]:
        path = report.figures / f"quality-paired-{stem}.png"
        yield path, paired.draw(report.results, condition, path)


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


SECTIONS = (
    Section("overview", 3, _table, applies=_has_scores),
    Section(
        "plot", 4, applies=lambda report: _has_scores(report) and report.layout.measure != "error_budget", figures=_plot
    ),
    Section("pictures", 6, applies=_has_scores, figures=lambda report: report.pictures(PICTURES, _pictures)),
    Section("other plots", 30, applies=_has_scores, figures=_other_plots, details=True),
    Section("stages", 90, figures=_stages, details=True),
)
