"""What changes of the displays cost: curves and pictures."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from ..charts.gallery import spread
from ..charts.look.methods import looks
from ..charts.rows import Row, draw_rows
from ..charts.sweeps import Curve, Panel, draw_sweep
from ..data.categories import OFFLINE, ONLINE
from ..data.results import CONSTANT
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
        draw_sweep(path, [_panel(sweep) for sweep in same], f"{results.headline.axis}{report.layout.text.axis}")
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


def _panel(sweep: Sweep) -> Panel:
    kind, points = sweep.kind, sweep.points
    results, looked, curves = sweep.results, looks(sweep.results.names), []
    for label in sweep.methods:
        means = tuple(sweep.mean(label, condition).mean for _, condition in points)
        reaches = tuple(_reach(sweep, label, condition) for _, condition in points)
        curves.append(Curve(label, means, reaches, looked[label], dashed=label == results.layout.baseline))
    before = sweep.swept.before
    has_floor = CONSTANT in results.floors and results.has_pictures(before)
    return Panel(
        title=before,
        axis=f"{kind.words}{f' [{kind.unit}]' if kind.unit else ''}",
        positions=tuple(float(value) if kind.numeric else float(index) for index, (value, _) in enumerate(points)),
        curves=tuple(curves),
        ticks=None if kind.numeric else tuple(sweep.text(value) for value, _ in points),
        nominal=kind.nominal,
        floor=float(results.row(CONSTANT, results.reference(before))[results.headline.column]) if has_floor else None,
    )


def _reach(sweep: Sweep, label: str, condition: str) -> tuple[float, float]:
    """How far the interval of the mean difference to the unchanged display reaches down and up."""
    loss = sweep.loss(label, condition) if condition != sweep.swept.before else None
    if loss is None:
        return 0.0, 0.0
    ends = loss.high - loss.mean, loss.mean - loss.low
    return ends if sweep.results.headline.higher_is_better else (ends[1], ends[0])


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
