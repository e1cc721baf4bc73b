"""What changes of the displays cost, in tables and sentences, and what the paper claims of three of them."""

from __future__ import annotations

from collections.abc import Sequence

from markupsafe import Markup

from .markdown import escape, table
from .results import Results
from .statistics import Estimate
from .sweeps import SMALL, Sweep
from .wording import words

PAPER = {
    "camera_shift_x": "the quality stays stable when the camera moves by up to 4 cm",
    "camera_shift_y": "the quality stays stable when the camera moves by up to 4 cm",
    "drift": "there is no significant change in quality over three months",
    "sensor": "captures of two cameras are consistent",
}
"""What Chakravarthula et al. 2020, Section 7.2, say of their method, by kind of change."""
REMEDIES = {"eye": ("corrected_eye", "known_eye")}
"""Kinds whose changes others are meant to undo."""


def shown(value: float | str) -> str:
    """A value as in a config."""
    return f"{value:g}" if isinstance(value, float) else value


def heading(sweep: Sweep) -> str:
    """What is changed, and on which display."""
    return f"{sweep.kind.words[0].upper()}{sweep.kind.words[1:]}: {sweep.swept.before}"


def introduction(sweep: Sweep) -> Markup:
    """The stages that change, and what is assumed."""
    stages = words([stage.replace("_", " ") for stage in sweep.kind.stages])
    seen = "The camera is registered anew." if sweep.kind.moves else "The registration of before holds."
    return escape(f"Changes: {stages}. Model: {sweep.kind.model}. {seen}")


def scores(sweep: Sweep) -> Markup:
    """Mean of the headline metric at every value."""
    score = sweep.results.headline
    unit = f" {sweep.kind.unit}" if sweep.kind.unit else ""
    points = sweep.points if sweep.kind.numeric else (("before", sweep.swept.before), *sweep.points)
    columns = ["method", *(f"{shown(value)}{unit}" if value != "before" else "before" for value, _ in points)]
    rows = [[label, *(score.number(sweep.mean(label, name).mean) for _, name in points)] for label in sweep.methods]
    return table(columns, rows)


def losses(sweep: Sweep) -> Markup:
    """What the worst change cost each method, the slope, and what is left above the baseline."""
    score, kind, baseline = sweep.results.headline, sweep.kind, sweep.results.layout.baseline
    unit = f" [{score.unit}]" if score.unit else ""
    per = f"loss per {kind.per:g} {kind.unit}{unit}"
    columns = ["method", "worst at", f"loss there{unit}", *([per] if kind.numeric else [])]
    columns += [f"above {baseline} there{unit}", *([f"falls to {baseline} at"] if kind.numeric else [])]
    rows = []
    for label in sweep.methods:
        worst, slope = sweep.worst(label), sweep.slope(label)
        if worst is None:
            continue
        value, loss = worst
        condition = dict(sweep.swept.points)[value]
        gained = sweep.gain(label, condition) if label != baseline else None
        row = [label, f"{shown(value)} {kind.unit}".strip(), _interval(sweep, loss)]
        row += [f"{slope.mean:+.3g} [{slope.low:+.3g}, {slope.high:+.3g}]" if slope else "–"] if kind.numeric else []
        row += [_interval(sweep, gained) if gained else "–"]
        row += [_break_even(sweep, label)] if kind.numeric else []
        rows.append(row)
    return table(columns, rows)


def _interval(sweep: Sweep, estimate: Estimate) -> str:
    return sweep.results.headline.interval(estimate.mean, estimate.low, estimate.high, signed=True)


def _break_even(sweep: Sweep, label: str) -> str:
    """Where an advantage ends; in words where there is none or it does not end."""
    if label == sweep.results.layout.baseline:
        return "–"
    before = sweep.gain(label, sweep.swept.before)
    if before is None or before.mean <= 0:
        return "not above it before"
    found = sweep.break_even(label)
    return words([f"{value:.3g} {sweep.kind.unit}".strip() for value in found]) if found else "nowhere in this range"


def sentences(sweep: Sweep, every: Sequence[Sweep]) -> list[str]:
    """What the sweep shows, from its numbers alone."""
    told = []
    if sweep.swept.kind == "refocus":
        told += _stated_range(sweep)
    for remedy in every:
        if remedy.swept.kind in REMEDIES.get(sweep.swept.kind, ()) and remedy.swept.before == sweep.swept.before:
            told += _recovered(sweep, remedy)
    return told


def _stated_range(sweep: Sweep) -> list[str]:
    ranges: dict[tuple[float, float], list[str]] = {}
    for label in sweep.methods:
        found = sweep.small_range(label)
        if found is not None:
            ranges.setdefault(found, []).append(label)
    unit = f" {sweep.kind.unit}" if sweep.kind.unit else ""
    return [
        f"Within {SMALL:g} dB of the score before the change from {low:g} to {high:g}{unit}: {words(labels)}."
        for (low, high), labels in ranges.items()
    ]


def _recovered(sweep: Sweep, remedy: Sweep) -> list[str]:
    told = []
    for label in sweep.methods:
        parts = [
            f"{value}: {100 * share.mean:.0f} % [{100 * share.low:.0f}, {100 * share.high:.0f}]"
            for value, share in sweep.recovered(label, remedy).items()
        ]
        if parts:
            told.append(f"Of what {sweep.kind.words} costs {label}, {remedy.kind.words} gets back: {'; '.join(parts)}.")
    return told


def claims(results: Results, every: Sequence[Sweep]) -> str:
    """One paragraph: the paper's three claims of robustness for its method, and what these sweeps say of each.

    Empty where the paper's method, or every one of the three changes, is missing.
    """
    labels = list(dict.fromkeys(results.frame.loc[results.frame["name"] == "hil", "method"]))
    told = []
    for sweep in every:
        for label in labels:
            worst = sweep.worst(label) if label in sweep.methods and sweep.swept.kind in PAPER else None
            if worst is not None:
                told.append(_claim(sweep, label, *worst))
    if not told:
        return ""
    rule = f"A claim is said to hold where the mean loss is at most {SMALL:g} dB at every value."
    return f"Chakravarthula et al. 2020 (Section 7.2) show pictures for three claims. {rule} {' '.join(told)}"


def _claim(sweep: Sweep, label: str, value: float | str, loss: Estimate) -> str:
    score, baseline = sweep.results.headline, sweep.results.layout.baseline
    verdict = "holds here" if loss.mean <= SMALL else "does not hold here"
    where = f"{sweep.kind.words}, {shown(value)} {sweep.kind.unit}".rstrip(" ,")
    sentence = (
        f"On {sweep.swept.before}, that {PAPER[sweep.swept.kind]} {verdict} for {label}: at worst ({where}) it loses "
        f"{score.interval(loss.mean, loss.low, loss.high)} {score.unit}"
    )
    condition = dict(sweep.swept.points)[value]
    gained, before = sweep.gain(label, condition), sweep.gain(label, sweep.swept.before)
    other = sweep.loss(str(baseline), condition)
    if gained is None or before is None or other is None:
        return f"{sentence}."
    return (
        f"{sentence}, {baseline} {score.number(other.mean)}, and its lead over {baseline} goes from "
        f"{score.number(before.mean, signed=True)} to {score.number(gained.mean, signed=True)} {score.unit}."
    )
