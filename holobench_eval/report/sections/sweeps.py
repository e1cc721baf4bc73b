"""What changes of the displays cost: curves and pictures."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from ..charts.curves import draw_sweep
from ..charts.look import slugs
from ..charts.tiles import draw_rows, spread
from ..data.layout import OFFLINE, ONLINE
from ..data.sweeps import Sweep
from ..data.text import grouped
from ..section import Report, Section

MOST_VALUES = 7  # pictures in a row; of more values, the nominal one and evenly spaced others are drawn
MOST_ROWS = 4


def _drawable(report: Report) -> list[Sweep]:
    """The sweeps with rows of methods."""
    return [sweep for sweep in report.sweeps if sweep.methods]


def _curves(report: Report) -> Iterator[tuple[Path, str]]:
    """Curves of every kind of change."""
    results = report.results
    for kind, same in grouped((sweep.swept.kind, sweep) for sweep in _drawable(report)).items():
        path = report.figures / f"quality-sweep-{kind}.png"
        draw_sweep(path, same, f"{results.headline.axis}{report.layout.text.axis}")
        yield (
            path,
            f"{results.headline.axis} along a change: {same[0].kind.words}. Mean over targets; bars, slightly offset: "
            "95 % interval of the paired mean difference to the unchanged display. Dashed: the baseline.",
        )


def _pictures(report: Report) -> Iterator[tuple[Path, str]]:
    """Rows of pictures of the target in the middle of their ranking by quality, a row a chosen method."""
    thumbnails, stems = report.thumbnails, slugs(report.results.conditions)
    first = report.results.conditions[0]
    if not thumbnails.targets(first):
        return
    target = thumbnails.middle(first)
    for sweep in _drawable(report):
        before, change = sweep.swept.before, sweep.kind.words
        points = spread(sweep.points, MOST_VALUES)
        rows = [
            (label, [(sweep.text(value), thumbnails.tile(label, name, target)) for value, name in points])
            for label in _chosen(sweep)
        ]
        path = report.figures / f"sweep-{sweep.swept.kind}-{stems[before]}.jpg"
        draw_rows(path, f"{before}: {change}", (target, thumbnails.targets(before)[target]), rows)
        yield path, f"Captures of {target} on {before} along a change: {change}."


def _chosen(sweep: Sweep) -> list[str]:
    """At most ``MOST_ROWS`` methods: the baseline, the paper's, then the best of the others on the display before the
    change, without the oracle."""
    results, before = sweep.results, sweep.swept.before
    first = [label for label in sweep.methods if label == results.layout.baseline]
    paper = [label for label in sweep.methods if results.names[label] == "hil"]
    ranked = results.ranking(before, categories=(*OFFLINE, ONLINE))
    others = [label for label in ranked if label in sweep.methods]
    return list(dict.fromkeys([*first, *paper, *others]))[:MOST_ROWS]


SECTIONS = (
    Section("along the changes", 45, applies=lambda report: bool(_drawable(report)), figures=_curves),
    Section(
        "pictures along the changes",
        46,
        applies=lambda report: bool(_drawable(report)),
        figures=lambda report: report.pictures("sweep-*.jpg", lambda: _pictures(report)),
    ),
)
