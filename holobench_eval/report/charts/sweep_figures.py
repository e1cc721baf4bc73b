"""The figures of sweeps: curves of every kind of change, and rows of pictures along it (paper Fig. 10)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from ..data.categories import OFFLINE, ONLINE
from ..data.sweeps import Sweep
from ..sections.sweeps import shown
from .gallery import Picture, Tile
from .rows import Row, draw_rows
from .sweeps import Curve, Panel, draw_sweep

MOST_VALUES = 7
"""Pictures in a row; of more values, the nominal one and evenly spaced others are shown."""
MOST_ROWS = 4

Take = Callable[[str, str, str], Tile]
"""Method, condition and target to the capture's tile."""


def draw(
    every: Sequence[Sweep], folder: Path, take: Take, target: tuple[str, Picture] | None
) -> Iterator[tuple[Path, str]]:
    """Draw the curves of every kind, and the rows of one target if there is one; (file, caption) of each."""
    kinds = dict.fromkeys(sweep.swept.kind for sweep in every)
    for kind in kinds:
        found = [sweep for sweep in every if sweep.swept.kind == kind and sweep.methods]
        if not found:
            continue
        results, said = found[0].results, found[0].kind
        path = folder / f"quality-sweep-{kind}.png"
        draw_sweep(path, [_panel(sweep) for sweep in found], f"{results.headline.axis}{results.layout.wording.axis}")
        what = f"{results.headline.axis} along a change: {said.words}. Mean over targets"
        bars = "bars: 95 % interval of the mean difference to the unchanged display, target by target"
        yield path, f"{what}; {bars}, moved apart a little. Dashed: the baseline."
        for sweep in found if target is not None else []:
            path = folder / f"sweep-{kind}-{_stem(sweep)}.jpg"
            rows = _rows(sweep, take, target[0]) if target else []
            draw_rows(path, f"{sweep.swept.before}: {said.words}", target or ("", np.ones((1, 1, 3))), rows)
            yield (
                path,
                f"Captures of {target[0] if target else ''} on {sweep.swept.before} along a change: {said.words}.",
            )


def _stem(sweep: Sweep) -> str:
    return "".join(c if c.isalnum() or c in "._-" else "-" for c in sweep.swept.before)


def _panel(sweep: Sweep) -> Panel:
    kind, points = sweep.kind, sweep.points
    if not kind.numeric:
        points = (("before", sweep.swept.before), *points)
    curves = []
    for label in sweep.methods:
        means = tuple(sweep.mean(label, condition).mean for _, condition in points)
        reaches = tuple(_reach(sweep, label, condition) for _, condition in points)
        curves.append(Curve(label, means, reaches, dashed=label == sweep.results.layout.baseline))
    places = tuple(float(value) for value, _ in points) if kind.numeric else tuple(map(float, range(len(points))))
    return Panel(
        title=sweep.swept.before,
        axis=f"{kind.words}{f' [{kind.unit}]' if kind.unit else ''}",
        places=places,
        curves=tuple(curves),
        ticks=None if kind.numeric else tuple(shown(value) for value, _ in points),
        nominal=kind.nominal,
    )


def _reach(sweep: Sweep, label: str, condition: str) -> tuple[float, float]:
    """How far the interval of the mean difference to the unchanged display reaches down and up."""
    loss = sweep.loss(label, condition) if condition != sweep.swept.before else None
    if loss is None:
        return 0.0, 0.0
    ends = loss.high - loss.mean, loss.mean - loss.low
    return ends if sweep.results.headline.higher_is_better else (ends[1], ends[0])


def _rows(sweep: Sweep, take: Take, target: str) -> list[Row]:
    """A row a method, see ``chosen``."""
    points = sweep.points if sweep.kind.numeric else (("before", sweep.swept.before), *sweep.points)
    if len(points) > MOST_VALUES:
        picks = np.linspace(0, len(points) - 1, MOST_VALUES).round().astype(int)
        points = tuple(points[index] for index in picks)
    unit = f" {sweep.kind.unit}" if sweep.kind.unit else ""
    heads = [value if value == "before" else f"{shown(value)}{unit}" for value, _ in points]
    return [
        Row(label, tuple((head, take(label, name, target)) for head, (_, name) in zip(heads, points, strict=True)))
        for label in chosen(sweep)
    ]


def chosen(sweep: Sweep) -> list[str]:
    """At most ``MOST_ROWS`` methods to be shown: the baseline, the paper's, then the best of the others on the display
    before the change, without the ceiling."""
    results, before = sweep.results, sweep.swept.before
    named = results.frame.drop_duplicates("method").set_index("method")["name"]
    first = [label for label in sweep.methods if label == results.layout.baseline]
    paper = [label for label in sweep.methods if named[label] == "hil"]
    ranked = results.ranking(before, tracks=(*OFFLINE, ONLINE))
    others = [label for label in ranked if label in sweep.methods]
    return list(dict.fromkeys([*first, *paper, *others]))[:MOST_ROWS]
