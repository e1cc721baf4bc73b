"""What changes of the displays cost: curves and pictures."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from ..charts.curves import draw_sweep
from ..charts.tiles import Row, draw_rows, spread
from ..data.layout import OFFLINE, ONLINE
from ..data.sweeps import Sweep
from ..section import Report, Section

MOST_VALUES = 7  # pictures in a row; of more values, the nominal one and evenly spaced others are drawn
MOST_ROWS = 4


def _by_kind(report: Report) -> list[list[Sweep]]:
    """The sweeps with rows of methods, those of a kind together."""
    drawable = [sweep for sweep in report.sweeps if sweep.methods]
    kinds = dict.fromkeys(sweep.swept.kind for sweep in drawable)
    return [[sweep for sweep in drawable if sweep.swept.kind == kind] for kind in kinds]


def _curves(report: Report) -> Iterator[tuple[Path, str]]:
    """Curves of every kind of change."""
    results = report.results
    for same in _by_kind(report):
        change, kind = same[0].kind.words, same[0].swept.kind
        path = report.figures / f"quality-sweep-{kind}.png"
        draw_sweep(path, same, f"{results.headline.axis}{report.layout.text.axis}")
        yield (
            path,
            f"{results.headline.axis} along a change: {change}. Mean over targets; bars, slightly offset: 95 % "
            "interval of the paired mean difference to the unchanged display. Dashed: the baseline.",
        )


def _pictures(report: Report) -> Iterator[tuple[Path, str]]:
    """Rows of pictures of the target in the middle of their ranking by quality."""
    thumbnails = report.thumbnails
    first = report.results.conditions[0]
    if not thumbnails.targets(first):
        return
    target = thumbnails.middle(first)
    for same in _by_kind(report):
        change, kind = same[0].kind.words, same[0].swept.kind
        for sweep in same:
            stem = "".join(c if c.isalnum() or c in "._-" else "-" for c in sweep.swept.before)
            path = report.figures / f"sweep-{kind}-{stem}.jpg"
            rows = _rows(report, sweep, target)
            draw_rows(
                path, f"{sweep.swept.before}: {change}", (target, thumbnails.targets(sweep.swept.before)[target]), rows
            )
            yield path, f"Captures of {target} on {sweep.swept.before} along a change: {change}."


def _rows(report: Report, sweep: Sweep, target: str) -> list[Row]:
    """A row of captures for each of the chosen methods."""
    points, tile = spread(sweep.points, MOST_VALUES), report.thumbnails.tile
    return [
        Row(label, tuple((sweep.text(value), tile(label, name, target)) for value, name in points))
        for label in _chosen(sweep)
    ]


def _chosen(sweep: Sweep) -> list[str]:
    """At most ``MOST_ROWS`` methods: the baseline, the paper's, then the best of the others on the display before the
    change, without the oracle."""
    results, before = sweep.results, sweep.swept.before
    first = [label for label in sweep.methods if label == results.layout.baseline]
    paper = [label for label in sweep.methods if results.names[label] == "hil"]
    ranked = results.ranking(before, categories=(*OFFLINE, ONLINE))
    others = [label for label in ranked if label in sweep.methods]
    return list(dict.fromkeys([*first, *paper, *others]))[:MOST_ROWS]


def _any(report: Report) -> bool:
    return any(sweep.methods for sweep in report.sweeps)


SECTIONS = (
    Section("along the changes", 45, applies=_any, figures=_curves),
    Section(
        "pictures along the changes",
        46,
        applies=_any,
        figures=lambda report: report.pictures("sweep-*.jpg", lambda: _pictures(report)),
    ),
)
