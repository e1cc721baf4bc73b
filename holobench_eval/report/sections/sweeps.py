"""What changes of the displays cost, in tables and sentences, and what the paper claims of three of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

from ..data.categories import ONLINE
from ..data.results import Results
from ..data.statistics import Estimate
from ..data.sweeps import SMALL, Sweep
from ..data.text import words
from ..markdown import escape, table
from . import tables as sections

PAPER = {
    "camera_shift_x": ("the quality stays stable when the camera moves by up to 4 cm", 40.0),
    "camera_shift_y": ("the quality stays stable when the camera moves by up to 4 cm", 40.0),
    "drift": ("there is no significant change in quality over three months", 90.0),
    "sensor": ("captures of two cameras are consistent", None),
}
"""What Chakravarthula et al. 2020, Section 7.2, say of their method, by kind of change, and how far a sweep has to go
to tell (None: two of a kind)."""
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
    rows = [
        [named(sweep.results, label), *(score.number(sweep.mean(label, name).mean) for _, name in points)]
        for label in sweep.methods
    ]
    return table(columns, rows)


def named(results: Results, name: str) -> str:
    """A label, marked for the ceiling and for methods that see the changed display while they solve."""
    return f"{name} (online)" if results.layout.track(name) == ONLINE else sections.label(results, name)


def losses(sweep: Sweep) -> Markup:
    """What the worst change cost each method, the slope, and what is left above the baseline."""
    score, kind, baseline = sweep.results.headline, sweep.kind, sweep.results.layout.baseline
    unit = f" [{score.unit}]" if score.unit else ""
    sides = {-1: " below", 1: " above"} if len(sweep.sides) > 1 else {-1: "", 1: ""}
    per = [f"loss per {kind.per:g} {kind.unit}{sides[side]}{unit}" for side in sweep.sides]
    columns = ["method", "worst at", f"loss there{unit}", *per]
    columns += [f"above {baseline} there{unit}", *([f"falls to {baseline} at"] if kind.numeric else [])]
    rows = []
    for label in sweep.methods:
        worst, slopes = sweep.worst(label), [sweep.slope(label, side) for side in sweep.sides]
        if worst is None:
            continue
        value, loss = worst
        condition = dict(sweep.swept.points)[value]
        gained = sweep.gain(label, condition) if label != baseline else None
        row = [named(sweep.results, label), f"{shown(value)} {kind.unit}".strip(), _interval(sweep, loss)]
        row += [_slope(slope) for slope in slopes]
        row += [_interval(sweep, gained) if gained else "–"]
        row += [_break_even(sweep, label)] if kind.numeric else []
        rows.append(row)
    return table(columns, rows) if rows else Markup("")


def _slope(slope: Estimate | None) -> str:
    if slope is None:
        return "–"
    ends = "" if np.isnan(slope.low) else f" [{slope.low:+.3g}, {slope.high:+.3g}]"
    return f"{slope.mean:+.3g}{ends}"


def _interval(sweep: Sweep, estimate: Estimate) -> str:
    return sweep.results.headline.interval(estimate.mean, estimate.low, estimate.high, signed=True)


def _break_even(sweep: Sweep, label: str) -> str:
    """Where an advantage ends; in words where there is none or it does not end."""
    if label == sweep.results.layout.baseline:
        return "–"
    before, found = sweep.gain(label, sweep.swept.before), sweep.break_even(label)
    if before is None or found is None:
        return "–"
    if before.mean <= 0:
        return "not above it before"
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
        f"Within {SMALL:g} {sweep.results.headline.unit} of the score before the change from {low:g} to "
        f"{high:g}{unit}: {words(labels)}."
        for (low, high), labels in ranges.items()
    ]


def _recovered(sweep: Sweep, remedy: Sweep) -> list[str]:
    told = []
    for label in sweep.methods:
        parts = [
            f"{value}: {100 * share.mean:.0f} %"
            f"{'' if np.isnan(share.low) else f' [{100 * share.low:.0f}, {100 * share.high:.0f}]'}"
            for value, share in sweep.recovered(label, remedy).items()
        ]
        if parts:
            told.append(f"Recovered of the loss by {remedy.swept.kind}, {label}: {'; '.join(parts)}.")
    return told


def claims(results: Results, every: Sequence[Sweep]) -> str:
    """One paragraph: the paper's three claims of robustness for its method, and what these sweeps say of each.

    Empty where the paper's method, or every one of the three changes, is missing, and for a headline that is not in dB.
    """
    if results.headline.unit != "dB":
        return ""
    labels = list(dict.fromkeys(results.frame.loc[results.frame["name"] == "hil", "method"]))
    told = []
    for sweep in every:
        for label in labels:
            if label in sweep.methods and sweep.swept.kind in PAPER:
                told.append(_claim(sweep, label))
    if not told:
        return ""
    rule = f"A claim is said to hold where the mean loss is at most {SMALL:g} dB at every value."
    return f"Chakravarthula et al. 2020 (Section 7.2) show pictures for three claims. {rule} {' '.join(told)}"


def _claim(sweep: Sweep, label: str) -> str:
    score, baseline = sweep.results.headline, sweep.results.layout.baseline
    said, far = PAPER[sweep.swept.kind]
    whole = len(sweep.losses(label)) == len(sweep.swept.points)
    reached = len(sweep.swept.points) > 1 if far is None else max(abs(float(v)) for v, _ in sweep.swept.points) >= far
    worst = sweep.worst(label)
    if not (whole and reached) or worst is None:
        lacking = "the sweep does not go so far" if whole else "some points have no score"
        return f"On {sweep.swept.before}, whether {said} for {label} cannot be told ({sweep.kind.words}): {lacking}."
    value, loss = worst
    verdict = "holds here" if loss.mean <= SMALL else "does not hold here"
    where = f"{sweep.kind.words}, {shown(value)} {sweep.kind.unit}".rstrip(" ,")
    sentence = (
        f"On {sweep.swept.before}, that {said} {verdict} for {label}: at worst ({where}) it loses "
        f"{score.interval(loss.mean, loss.low, loss.high)} {score.unit}"
    )
    if label == baseline:
        return f"{sentence}."
    condition = dict(sweep.swept.points)[value]
    gained, before = sweep.gain(label, condition), sweep.gain(label, sweep.swept.before)
    other = sweep.loss(str(baseline), condition)
    if gained is None or before is None or other is None:
        return f"{sentence}."
    return (
        f"{sentence}, {baseline} {score.number(other.mean)}, and its lead over {baseline} goes from "
        f"{score.number(before.mean, signed=True)} to {score.number(gained.mean, signed=True)} {score.unit}."
    )
