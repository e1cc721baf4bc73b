"""The leaderboard as a table: a group of comparable rows below a line that says what they share."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from markupsafe import Markup

from ..data.statistics import Estimate
from ..data.text import FILES
from .html import joined, link, plain_number, quiet, slug, swatch
from .intake import Source
from .standing import ANOTHER, UNRECORDED, Group, Row

MEASURED = {
    "picture": "captures against targets",
    "focus": "captures of focal stacks against targets",
    "prediction": "predictions against captures",
    "error_budget": "predictions against captures (error budget)",
    FILES: "photographs given as files against targets",
}
HEADINGS = (  # key to sort by, heading, the better direction
    ("", "rank in category", ""),
    ("display", "display", "up"),
    ("score", "score", "down"),
    ("structure", "MS-SSIM", "down"),
    ("brightness", "brightness ratio", "down"),
    ("gain", "difference to the baseline", "down"),
    ("above", "above the constant image", "down"),
    ("captures", "captures in total", "up"),
    ("seconds", "seconds a target", "up"),
    ("targets", "targets", "down"),
    ("study", "study, whose result", "up"),
)


@dataclass(frozen=True)
class Names:
    """Where the page of each thing is: the slug of a study, by its folder. up: the way to the index."""

    studies: Mapping[str, str]
    up: str = ""

    def method(self, row: Row) -> str:
        """The page of a row's method."""
        return f"{self.up}methods/{slug(row.method)}.html"

    def display(self, title: str) -> str:
        """The page of a display."""
        return f"{self.up}displays/{slug(title)}.html"

    def study(self, source: Source) -> Markup:
        """A link to the page of a study."""
        return link(f"{self.up}studies/{self.studies[str(source.folder)]}.html", source.name)


def board(groups: Iterable[Group], names: Names, keep: Iterable[Row] | None = None) -> Markup:
    """The table of some groups. keep: the rows that are shown (None: all)."""
    kept = None if keep is None else {id(row) for row in keep}
    bodies = joined(_group(group, names, kept) for group in groups)
    heads = joined(
        Markup('<th scope="col" data-key="{}" data-better="{}"{}>{}</th>').format(
            key, better, Markup(' class="across"') if key == "display" else _within(key), text
        )
        for key, text, better in (("method", "method", "up"), *HEADINGS)
    )
    return Markup(
        '<div class="scroll" tabindex="0" role="region" aria-label="Table of scores"><table class="board">'
        '<caption class="hidden">Scores of methods in groups within which they compare</caption>'
        "<thead><tr>{}</tr></thead>{}</table></div>"
    ).format(heads, bodies)


def _within(key: str) -> Markup:
    """The class of columns that mean nothing beyond a group."""
    return Markup(' class="within"') if key in ("", "score", "structure", "brightness", "above") else Markup("")


def measured(group: Group) -> tuple[str, str]:
    """What was measured, by which metric: its key in a view, and in words."""
    return f"{group.measure} {group.metric.key}", f"{MEASURED[group.measure]}, {group.metric.heading}"


def describe(group: Group, names: Names) -> Markup:
    """What the rows of a group share, as a line."""
    clusters = f" in {group.clusters} clusters" if group.clusters != group.targets else ""
    facts = [
        measured(group)[1],
        f"{group.targets} targets{clusters}",
        f"panel {group.panel} px" if group.panel else "panel not recorded",
        *([f"{group.exposure} exposure"] if group.exposure else []),
        f"protocol {group.protocol}",
        f"harness {group.harness}" if group.harness else "harness not recorded",
        f"baseline {' or '.join(group.baselines)}" if group.baselines else "no baseline",
    ]
    if turned := _turned(group):
        facts.append(f"by MS-SSIM first: {turned}")
    mark = f", {group.version}" if group.version in (ANOTHER, UNRECORDED) else ""
    return Markup("<strong>{}</strong> (group {}{}): {}.").format(
        link(names.display(group.display.title), group.display.marked), group.number, mark, "; ".join(facts)
    )


def _group(group: Group, names: Names, kept: set[int] | None) -> Markup:
    rows = [row for row in group.rows if kept is None or id(row) in kept]
    if not rows:
        return Markup("")
    head = Markup('<tr class="group"><th colspan="{}" scope="rowgroup" id="group-{}"><div>{}</div></th></tr>\n').format(
        len(HEADINGS) + 1, group.number, describe(group, names)
    )
    lines = joined(_row(row, group, names) for row in rows)
    return Markup('<tbody data-version="{}">{}{}</tbody>\n').format(group.version, head, lines)


def _row(row: Row, group: Group, names: Names) -> Markup:
    studies = " ".join(source.name for source in row.sources)
    words = " ".join((row.marked, row.method, row.category, group.display.marked, studies, row.whose)).lower()
    sign, gain = row.metric.sign, 0.0 if row.is_baseline else math.nan  # sorting is by what is better
    values = {
        "method": row.marked.lower(),
        "display": group.display.marked,
        "category": row.category,
        "measure": measured(group)[0],
        "version": group.version,
        "study": f"{studies} {row.whose}",
        "score": _value(sign * row.score.mean),
        **dict(zip(("structure", "brightness"), map(_value, _beside(row)), strict=True)),
        "gain": _value(sign * row.gain.mean if row.gain else gain),
        "above": _value(sign * row.above.mean if row.above else math.nan),
        "captures": _value(_number(row, "total_captures", "captures")),
        "seconds": _value(_number(row, "solving_s")),
        "targets": len(row.values),
        "text": words,
    }
    attributes = joined(Markup(' data-{}="{}"').format(key, value) for key, value in values.items())
    name = Markup('<th scope="row">{}{}</th>').format(swatch(row.method), link(names.method(row), row.marked))
    cells = (
        ("within", _rank(row, group)),
        ("across", Markup("{}{}").format(link(names.display(group.display.title), group.display.marked),
                                         quiet(f"group {group.number}, {group.metric.heading}, {group.version}"))),
        ("within", _estimate(row, row.score, signed=False)),
        *(("within", "–" if math.isnan(value) else f"{value:.3f}") for value in _beside(row)),
        ("", _gain(row, group)),
        ("within", _estimate(row, row.above) if row.above else "–"),
        ("", _captures(row)),
        ("", _seconds(row)),
        ("", _targets(row)),
        ("", _study(row, names)),
    )  # fmt: skip
    body = joined(Markup('<td class="{}">{}</td>').format(kind, cell) for kind, cell in cells)
    return Markup("<tr{}>{}{}</tr>\n").format(attributes, name, body)


def _rank(row: Row, group: Group) -> Markup:
    if row.rank is None:
        place = "further run" if row.is_further else "not ranked"
    else:
        place = f"{row.rank} of {group.ranked[row.category]}" if group.ranked[row.category] > 1 else "alone"
    return Markup("{} {}").format(place, quiet(row.category))


def _estimate(row: Row, estimate: Estimate, signed: bool = True) -> Markup:
    if math.isnan(estimate.mean):
        return Markup('<span class="hole">no score</span>')
    text, _, interval = row.metric.estimate(estimate, signed).partition(" ")
    return Markup("{} {}").format(text, quiet(interval) if interval else quiet("no interval"))


def _gain(row: Row, group: Group) -> Markup:
    if row.is_baseline:
        return Markup("baseline")
    if row.gain is None:
        return Markup("–")
    kind = "interval" if len(group.baselines) > 1 else "interval to"
    return Markup('{}<span class="{}">to {}</span>').format(_estimate(row, row.gain), kind, row.baseline)


def _beside(row: Row) -> tuple[float, float]:
    """MS-SSIM and brightness ratio, where they stand beside the score."""
    first, second = (*(_number(row, score.column) for score in row.source.results.beside), math.nan, math.nan)[:2]
    return first, second


def _turned(group: Group) -> str:
    """Who is first of a category by MS-SSIM and not by the score."""
    found = []
    for category in group.ranked:
        rows = [row for row in group.rows if row.rank is not None and row.category == category]
        best = max(rows, key=lambda row: round(_beside(row)[0], 3))  # of equal ones the best by the score
        if best.rank != 1 and not math.isnan(_beside(best)[0]):
            found.append(f"{best.marked} ({category})")
    return ", ".join(found)


def _captures(row: Row) -> Markup:
    total, each, training = (_number(row, key) for key in ("total_captures", "captures", "training_captures"))
    if math.isnan(total):
        return Markup("{}{}").format(plain_number(each), quiet("a target") if each == each else "")
    parts = f"{plain_number(training)} to train, " if training > 0 else ""
    return Markup("{} {}").format(plain_number(total), quiet(f"{parts}{plain_number(each)} a target"))


def _seconds(row: Row) -> Markup:
    training = _number(row, "training_s")
    trained = quiet(f"{plain_number(training)} s to train") if training > 0 else ""
    return Markup("{} {}{}").format(plain_number(_number(row, "solving_s")), quiet(row.source.processor), trained)


def _targets(row: Row) -> Markup:
    clusters = quiet(f"in {row.score.clusters} clusters") if row.score.clusters != row.score.n else ""
    if row.is_complete:
        return Markup("{} {}").format(row.planned, clusters)
    failed = f"{row.failed} failed" if row.failed else "others not measured"
    return Markup('<span class="hole">{} of {}, {}</span> {}').format(len(row.values), row.planned, failed, clusters)


def _study(row: Row, names: Names) -> Markup:
    every = Markup(", ").join(names.study(source) for source in row.sources)
    return Markup("{} {}").format(every, quiet(row.whose))


def _number(row: Row, *keys: str) -> float:
    """The first of some columns of table.csv that is known."""
    found = (float(row.table[key]) for key in keys if key in row.table)
    return next((value for value in found if not math.isnan(value)), math.nan)


def _value(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.6g}"
