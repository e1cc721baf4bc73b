"""What changes of the displays cost, in tables and sentences, and what the paper claims of three of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from ..charts.look.methods import looks
from ..charts.rows import Row, draw_rows
from ..charts.sweeps import Curve, Panel, draw_sweep
from ..data.categories import OFFLINE, ONLINE
from ..data.phrases import CONSTANT
from ..data.results import Results
from ..data.statistics import Estimate
from ..data.sweeps import SMALL, Sweep
from ..data.text import percent, words
from ..markdown import Markdown, bullets, heading, table
from ..section import Blocks, Figures, Report, Section

# What Chakravarthula et al. 2020, Section 7.2, say of their method, by kind of change, and how far a sweep has to go to
# tell (None: two of a kind).
PAPER = {
    "camera_shift_x": ("The quality stays stable when the camera moves by up to 4 cm", 40.0),
    "camera_shift_y": ("The quality stays stable when the camera moves by up to 4 cm", 40.0),
    "drift": ("There is no significant change in quality over three months", 90.0),
    "sensor": ("Captures of two cameras are consistent", None),
}
REMEDIES = {"eye": ("corrected_eye", "known_eye")}  # kinds whose changes others are meant to undo
MOST_VALUES = 7  # pictures in a row; of more values, the nominal one and evenly spaced others are drawn
MOST_ROWS = 4


def _render(report: Report, figures: Figures) -> Blocks:
    results, sweeps = report.results, report.sweeps
    yield heading("Changes of the displays")
    yield (
        "Methods are prepared on the display before the change, and their holograms are shown on it after the change. "
        "A method that captures the scored image solves under the change. A loss is the paired difference to the score "
        "before the change, positive where the picture got worse. Slopes are least-squares lines through zero, one on "
        "each side of the unchanged display."
    )
    yield claims(results, sweeps)
    for sweep in sweeps:
        if sweep.methods:
            words = sweep.kind.words
            yield heading(f"{words[0].upper()}{words[1:]}: {sweep.swept.before}", 3)
            yield _introduction(sweep)
            yield Markdown("{}:").format(results.headline.axis)
            yield scores(sweep)
            yield losses(sweep)
            yield bullets(sentences(sweep, sweeps))
    yield from figures


def value_text(value: float | str) -> str:
    """A value as in a config."""
    return f"{value:g}" if isinstance(value, float) else value


def _introduction(sweep: Sweep) -> str:
    """The stages that change, and what is assumed."""
    stages = words([stage.replace("_", " ") for stage in sweep.kind.stages])
    seen = "The camera is registered anew." if sweep.kind.moves else "The registration from before the change is kept."
    return f"Changes: {stages}. Model: {sweep.kind.model}. {seen}"


def scores(sweep: Sweep) -> Markdown:
    """Mean of the headline metric at every value."""
    score = sweep.results.headline
    rows = [
        [_marked(sweep.results, label), *(score.number(sweep.mean(label, name).mean) for _, name in sweep.points)]
        for label in sweep.methods
    ]
    return table(["method", *(_with_unit(sweep, value) for value, _ in sweep.points)], rows)


def _with_unit(sweep: Sweep, value: float | str) -> str:
    unit = f" {sweep.kind.unit}" if sweep.kind.unit and value != "before" else ""
    return f"{value_text(value)}{unit}"


def _marked(results: Results, name: str) -> str:
    """A label, marked for the oracle and for methods that see the changed display while they solve."""
    return f"{name} (online)" if results.layout.category(name) == ONLINE else results.layout.marked(name)


def losses(sweep: Sweep) -> Markdown | None:
    """What the worst change cost each method, the slope, and what is left above the baseline."""
    score, kind, baseline = sweep.results.headline, sweep.kind, sweep.results.layout.baseline
    sides = {-1: " below", 1: " above"} if len(sweep.sides) > 1 else {-1: "", 1: ""}
    per = [f"loss per {kind.per:g} {kind.unit}{sides[side]}{score.brackets}" for side in sweep.sides]
    columns = ["method", "worst at", f"loss there{score.brackets}", *per]
    columns += [f"above {baseline} there{score.brackets}", *([f"falls to {baseline} at"] if kind.numeric else [])]
    rows = []
    for label in sweep.methods:
        worst, slopes = sweep.worst(label), [sweep.slope(label, side) for side in sweep.sides]
        if worst is None:
            continue
        value, loss = worst
        condition = dict(sweep.swept.points)[value]
        gained = sweep.gain(label, condition) if label != baseline else None
        row = [
            _marked(sweep.results, label),
            f"{value_text(value)} {kind.unit}".strip(),
            score.estimate(loss, signed=True),
        ]
        row += [_slope(slope) for slope in slopes]
        row += [score.estimate(gained, signed=True) if gained else "–"]
        row += [_break_even(sweep, label)] if kind.numeric else []
        rows.append(row)
    return table(columns, rows) if rows else None


def _slope(slope: Estimate | None) -> str:
    if slope is None:
        return "–"
    ends = "" if np.isnan(slope.low) else f" [{slope.low:+.3g}, {slope.high:+.3g}]"
    return f"{slope.mean:+.3g}{ends}"


def _break_even(sweep: Sweep, label: str) -> str:
    """Where an advantage ends; in words where there is none or it does not end."""
    if label == sweep.results.layout.baseline:
        return "–"
    before, ends = sweep.gain(label, sweep.swept.before), sweep.break_even(label)
    if before is None or ends is None:
        return "–"
    if before.mean <= 0:
        return "not above it before"
    return words([f"{value:.3g} {sweep.kind.unit}".strip() for value in ends]) if ends else "nowhere in this range"


def sentences(sweep: Sweep, sweeps: Sequence[Sweep]) -> list[str]:
    """What the sweep shows, from its numbers alone; sweeps: all of the study."""
    lines = _stated_range(sweep) if sweep.swept.kind == "refocus" else []
    for remedy in sweeps:
        if remedy.swept.kind in REMEDIES.get(sweep.swept.kind, ()) and remedy.swept.before == sweep.swept.before:
            lines += _recovered(sweep, remedy)
    return lines


def _stated_range(sweep: Sweep) -> list[str]:
    ranges: dict[str, list[str]] = {}
    for label in sweep.methods:
        if reach := sweep.small_range(label):
            ranges.setdefault(reach, []).append(label)
    limit = f"{SMALL:g} {sweep.results.headline.unit}"
    return [
        f"The score changes by at most {limit} {reach if reach == 'nowhere' else f'from {reach}'}: {words(labels)}."
        for reach, labels in ranges.items()
    ]


def _recovered(sweep: Sweep, remedy: Sweep) -> list[str]:
    lines = []
    for label in sweep.methods:
        parts = [f"{value}: {percent(share)} %" for value, share in sweep.recovered(label, remedy).items()]
        if parts:
            lines.append(f"Share of the loss that {remedy.swept.kind} recovers for {label}: {'; '.join(parts)}.")
    return lines


def claims(results: Results, sweeps: Sequence[Sweep]) -> str:
    """One paragraph: the paper's three claims of robustness for its method, and what these sweeps say of each.

    Empty where the paper's method, or every one of the three changes, is missing, and for a headline that is not in dB.
    """
    if results.headline.unit != "dB":
        return ""
    labels = list(dict.fromkeys(results.frame.loc[results.frame["method"] == "hil", "label"]))
    verdicts = [
        _claim(sweep, label)
        for sweep in sweeps
        for label in labels
        if label in sweep.methods and sweep.swept.kind in PAPER
    ]
    if not verdicts:
        return ""
    rule = (
        f"A claim holds here if the 95 % interval of the largest mean loss ends at or below {SMALL:g} dB, does not if "
        "it begins above, and else neither is shown."
    )
    return f"Chakravarthula et al. 2020 (Section 7.2) support three claims with pictures. {rule} {' '.join(verdicts)}"


def _claim(sweep: Sweep, label: str) -> str:
    score, baseline = sweep.results.headline, sweep.results.layout.baseline
    claim, far = PAPER[sweep.swept.kind]
    complete = len(sweep.losses(label)) == len(sweep.swept.points)
    reached = len(sweep.swept.points) > 1 if far is None else max(abs(float(v)) for v, _ in sweep.swept.points) >= far
    worst = sweep.worst(label)
    if not (complete and reached) or worst is None:
        lacking = "the sweep does not go far enough" if complete else "some points have no score"
        return f'"{claim}" cannot be judged for {label} on {sweep.swept.before} ({sweep.kind.words}): {lacking}.'
    value, loss = worst
    verdict = "holds" if loss.high <= SMALL else "does not hold" if loss.low > SMALL else "is not shown to hold or fail"
    where = f"{sweep.kind.words}, {value_text(value)} {sweep.kind.unit}".rstrip(" ,")
    sentence = (
        f'"{claim}" {verdict} for {label} on {sweep.swept.before}: its largest loss ({where}) is '
        f"{score.estimate(loss)} {score.unit}"
    )
    if label == baseline:
        return f"{sentence}."
    condition = dict(sweep.swept.points)[value]
    gained, before = sweep.gain(label, condition), sweep.gain(label, sweep.swept.before)
    other = sweep.loss(str(baseline), condition)
    if gained is None or before is None or other is None:
        return f"{sentence}."
    return (
        f"{sentence}, that of {baseline} there {score.number(other.mean)}, and its lead over {baseline} goes from "
        f"{score.number(before.mean, signed=True)} to {score.number(gained.mean, signed=True)} {score.unit}."
    )


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
        ticks=None if kind.numeric else tuple(value_text(value) for value, _ in points),
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
    points = sweep.points
    if len(points) > MOST_VALUES:
        picks = np.linspace(0, len(points) - 1, MOST_VALUES).round().astype(int)
        points = tuple(points[index] for index in picks)
    return [
        Row(
            label,
            tuple((_with_unit(sweep, value), report.thumbnails.tile(label, name, target)) for value, name in points),
        )
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
    Section("along the changes", 45, lambda _, figures: figures, applies=_any, figures=_curves),
    Section(
        "sweeps",
        50,
        _render,
        applies=_any,
        figures=lambda report: report.pictures("sweep-*.jpg", lambda: _pictures(report)),
        details=True,
    ),
)
