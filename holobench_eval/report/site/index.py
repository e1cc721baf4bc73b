"""The first page: filters, the leaderboard, and lists of displays, methods and studies."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from markupsafe import Markup

from ..data.categories import meanings
from .board import MEASURED, Names, board, measured
from .html import joined, link, listed, page, swatch, table
from .intake import Source
from .standing import ANOTHER, UNRECORDED, Group, Row

FACTS = (
    "A group has one display, set of targets, panel, exposure rule, metric, protocol and version of the harness. Only "
    "within it are scores compared and ranked, each category by itself, and only rows with a score for every target.",
    "Targets of one name are taken for the same image where a constant image has the same score on each of them. A "
    "study without such a score for every target, or without a recorded version of the harness, is a group of its own.",
    "Scores of different groups do not compare: targets, displays or exposures differ. The view across groups shows "
    "paired differences in one metric instead. They say less than a rank: baselines differ, too.",
    "Differences are paired with the baseline of the row's own study. Ranks count methods with their parameters: the "
    'row of an own study before those of others; any more are "further runs".',
    "Above the constant image: the score minus that of an even picture in the place of a capture. Below zero, "
    "the capture may still show the picture: MS-SSIM says more of that.",
    "Seconds were taken on the processor beside them. They do not compare between processors.",
    f'"{ANOTHER.capitalize()}": the harness, the files of the report or the profile are not those of this version. '
    f'"{UNRECORDED.capitalize()}": the report does not say.',
    '"Own": the folder names nobody else.',
)


def index(groups: Sequence[Group], sources: Sequence[Source], without: Sequence[Path], names: Names) -> bytes:
    """The first page: filters, leaderboard, and lists of displays, methods and studies."""
    displays = {group.display.title: group.display for group in groups}
    rows = [row for group in groups for row in group.rows]
    methods = {row.method: row for row in rows}
    left = listed(f"{path.name}: no records.csv, left out" for path in without) if without else ""
    body = Markup(
        "<p>{count} rows of {methods} methods on {displays} displays, from {studies} studies. Scores compare within a "
        'group, and ranks are given there alone: see <a href="#compared">what is compared</a>. Brackets hold 95 % '
        "intervals over clusters of targets, not adjusted for the number of rows; the tests of a study are in its "
        'report.</p>\n{controls}\n<p id="status" role="status" aria-live="polite"></p>\n{board}\n'
        '<section id="displays"><h2>Displays</h2>{display_list}</section>\n'
        '<section id="methods"><h2>Methods</h2>{method_list}</section>\n'
        '<section id="studies"><h2>Studies</h2>{study_list}{left}</section>\n'
        '<section id="compared"><h2>What is compared</h2>{compared}</section>'
    ).format(
        count=len(rows),
        methods=len(methods),
        displays=len(displays),
        studies=len(sources),
        controls=_controls(groups, rows),
        board=board(groups, names),
        display_list=_display_list(groups, names),
        method_list=_method_list(rows, names),
        study_list=_study_list(groups, sources, names),
        left=left,
        compared=_compared({row.category for row in rows}),
    )
    return page("Leaderboard of phase retrieval on holographic displays", body, scripts=True)


def _controls(groups: Sequence[Group], rows: Sequence[Row]) -> Markup:
    displays = sorted({group.display.marked for group in groups})
    measures = dict.fromkeys(map(measured, groups))
    categories = [name for name, _ in meanings({row.category for row in rows})]
    choices = {
        "arrange": ("Compared", [("within", "within groups"), ("across", "across groups")]),
        "display": ("Display", [("", "all displays"), *((name, name) for name in displays)]),
        "category": ("Category", [("", "all categories"), *((name, name) for name in categories)]),
        "measure": ("Measured", [("", "everything"), *measures]),
        "version": ("Versions", [("new", "without other ones"), ("", "all versions")]),
    }
    selects = joined(
        Markup('<label>{} <select id="{}">{}</select></label>\n').format(
            title, key, joined(Markup('<option value="{}">{}</option>').format(*option) for option in options)
        )
        for key, (title, options) in choices.items()
    )
    return Markup(
        '<div class="controls" role="search" aria-label="What is shown" hidden>{}'
        '<label>Captures, at most <input id="captures" type="number" min="0" step="1"></label>\n'
        '<label>Seconds, at most <input id="seconds" type="number" min="0" step="any"></label>\n'
        '<label class="wide">Text <input id="text" type="search" autocomplete="off"></label>\n'
        '<button type="button" id="reset">Reset</button>\n'
        '<button type="button" id="copy-link">Copy link to this view</button></div>'
    ).format(selects)


def _display_list(groups: Sequence[Group], names: Names) -> Markup:
    found: dict[str, list[Group]] = {}
    for group in groups:
        found.setdefault(group.display.title, []).append(group)
    rows = (
        (
            link(names.display(title), same[0].display.marked),
            same[0].display.kind,
            len({row.method for group in same for row in group.rows}),
            len({row.source.name for group in same for row in group.rows}),
            ", ".join(dict.fromkeys(group.version for group in same)),
        )
        for title, same in sorted(found.items())
    )
    return table("Displays", ("display", "kind", "methods", "studies", "versions"), rows)


def _method_list(rows: Sequence[Row], names: Names) -> Markup:
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(row.method, []).append(row)
    lines = (
        (
            Markup("{}{}").format(swatch(method), link(names.method(same[0]), method)),
            ", ".join(dict.fromkeys(row.category for row in same)),
            len({row.display.title for row in same}),
            len({row.source.name for row in same}),
        )
        for method, same in sorted(found.items())
    )
    return table("Methods", ("method", "category", "displays", "studies"), lines)


def _study_list(groups: Sequence[Group], sources: Sequence[Source], names: Names) -> Markup:
    rows = (
        (
            names.study(source),
            source.by or "own",
            MEASURED[source.measure],
            len(source.results.targets),
            _version(groups, source),
            source.processor,
        )
        for source in sources
    )
    return table(
        "Studies", ("study", "whose result", "measured", "targets", "version", "processor"), rows, numbers=False
    )


def _version(groups: Iterable[Group], source: Source) -> str:
    rows = ((group, row) for group in groups for row in group.rows)
    return next((group.version for group, row in rows if source in row.sources), "")


def _compared(categories: set[str]) -> Markup:
    known = (Markup("<strong>{}</strong> {}").format(name, text) for name, text in meanings(categories))
    return Markup("{}<h3>Categories</h3>{}").format(listed(FACTS), listed(known))
