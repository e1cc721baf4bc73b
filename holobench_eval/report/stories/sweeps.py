"""Sweeps: what does a change of the display cost each method, and where does a lead over the baseline end?"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from ...display.simulated.changes import KINDS
from ..board import Board, is_gray
from ..charts.curves import draw_sweep
from ..charts.look import slugs
from ..charts.tiles import draw_rows, spread
from ..facts import OFFLINE, ONLINE, Swept
from ..markdown import DETAILS, Markdown, blocks, heading, table_of
from ..phrases import difference
from ..results import Results
from ..scores import Score
from ..statistics import Estimate, ratio_interval
from ..story import Blocks, Figures, Part, Report, subjects
from ..text import grouped, percent, words

ORDER = 60
QUESTION = "What does a change of the display cost each method?"
TESTS = False
SMALL = 1.0  # dB; a mean loss up to this is called small, as in the acceptance test of a moved image
LIMITS = (
    "Changes: methods are prepared before a change; models and rates of the changes are assumed. A claim holds if the "
    f"interval of the largest loss ends at or below {SMALL:g} dB.",
)

REMEDIES = ("corrected_eye", "known_eye")  # kinds that are meant to undo changes of the kind eye
MOST_VALUES = 7  # pictures in a row; of more values, the nominal one and evenly spaced others are drawn
MOST_ROWS = 4


class Point(NamedTuple):
    """A method on a display under one value of a kind of change, or before it.

    text: the value with its unit; condition: under which cells stand for it; loss: what the change cost, target by
    target, positive where the score got worse, None before the change; lead: over the baseline under the same change,
    positive where it is better, None of the baseline. Both are None where a target has no score.
    """

    display: str
    kind: str
    method: str
    value: float | str
    text: str
    condition: str
    loss: Estimate | None
    lead: Estimate | None

    @property
    def change(self) -> str:
        """What changes, in words."""
        return KINDS[self.kind].words

    @property
    def is_before(self) -> bool:
        """Whether nothing is changed."""
        return self.condition == self.display


def sweeps(results: Results) -> dict[tuple[str, str, str], list[Point]]:
    """The points of every display, kind of change and method that is planned at every value of it."""

    def better(first: tuple[str, str], second: tuple[str, str]) -> Estimate | None:
        by = results.headline.sign * (results.values(*first) - results.values(*second))
        return None if np.isnan(by).any() else results.estimate(by)

    def point(swept: Swept, label: str, value: float | str, name: str) -> Point:
        text = f"{f'{value:g}' if isinstance(value, float) else value} {KINDS[swept.kind].unit}".strip()
        loss = better((label, swept.before), (label, name)) if name != swept.before else None
        lead = better((label, name), (baseline, name)) if baseline not in (None, label) else None
        return Point(swept.before, swept.kind, label, value, text, name, loss, lead)

    baseline = results.baseline
    return {
        (swept.before, swept.kind, label): [point(swept, label, *place) for place in _places(swept)]
        for swept in results.facts.sweeps
        for label in _methods(results, swept)
    }


def _places(swept: Swept) -> list[tuple[float | str, str]]:
    """(value, condition), by value, the unchanged display at its place; it leads as ``before`` where the values are no
    numbers."""
    nominal = KINDS[swept.kind].nominal
    if nominal is None:
        return [("before", swept.before), *swept.points]
    return sorted([(nominal, swept.before), *swept.points], key=lambda point: float(point[0]))


def _methods(results: Results, swept: Swept) -> list[str]:
    """Those that are planned at every value; of draws, which are other benches and are asked for rankings, none."""
    first, *others = (results.methods(name) for _, name in _places(swept))
    return [label for label in first if swept.kind != "draw" and all(label in planned for planned in others)]


def applies(results: Results) -> bool:
    """Whether a method is planned at every value of a change."""
    return any(_methods(results, swept) for swept in results.facts.sweeps)


def verdicts(results: Results) -> Iterator[str]:
    """One a display, how far a lens moves the picture or what glasses get back, else one a method, what changes cost at
    most; then the claims of the config."""
    swept = sweeps(results)
    displays = grouped((points[0].display, points) for points in swept.values())
    for display, here in displays.items():
        named = f"{display}: " * (len(displays) > 1)
        costs = (cost for label in _followed(results, display) for cost in _costs(results, here, label))
        own = [*_seen(results, here), *_ranges(results, here), *_recovered(results, here)]
        yield from (f"{named}{text}" for text in own or costs)
    asked = itertools.product(results.facts.sweeps, subjects(results)[:1])
    claims = ((sweep.claim, swept.get((sweep.before, sweep.kind, label))) for sweep, label in asked if sweep.claim)
    known = ((claim.says, _judged(results, points, claim.until)) for claim, points in claims if points)
    for says, judged in grouped(known).items():
        fails, holds = ([text for is_held, text, _ in judged if is_held == held] for held in (False, True))
        where = [f"It holds for {words([change for is_held, _, change in judged if is_held])}."] * bool(holds)
        yield f'"{says}" {" ".join([*fails, *where] if fails else holds)}'


def _followed(results: Results, before: str) -> list[str]:
    """The methods of the question, and the best before the change, if there are any of those that solve before it.

    Where that is the baseline alone, also the next.
    """
    ranked = [results.ranking(before, categories=categories) for categories in (OFFLINE, (ONLINE,))]
    best, baseline = (ranked[0] or ranked[1])[:1], results.baseline
    followed = list(dict.fromkeys([*subjects(results), *best]))
    others = [label for label in (*ranked[0], *ranked[1]) if label != baseline]
    return [*followed, *others[:1]] if followed == [baseline] else followed


def _lost(points: Iterable[Point]) -> list[tuple[Point, Estimate]]:
    """The points whose loss is known, the largest loss first."""
    return sorted(((point, point.loss) for point in points if point.loss), key=lambda each: -each[1].mean)


def _costs(results: Results, here: list[list[Point]], label: str) -> Iterator[str]:
    """The largest mean loss of a method, and whether its lead over the baseline lasts."""
    score, baseline = results.headline, results.baseline
    points = [point for points in here for point in points if point.method == label]
    for worst, loss in _lost(points)[:1]:
        cost = f"{label} {_moved(score, loss)} at most, with {worst.change}, {worst.text}"
        lead = next(point.lead for point in points if point.is_before)
        if lead is None:
            yield f"{cost}."
        elif not lead.low > 0:
            no = "It has no lead" if lead.mean <= 0 else "No lead is shown"
            yield f"{cost}. {no} over {baseline} to lose: {score.with_unit(lead.mean, signed=True)} before."
        else:
            leads = [point.lead for point in points if not point.is_before]
            least = min((lead for lead in leads if lead), key=lambda lead: lead.mean, default=lead)
            told = f"Its lead over {baseline} is not shown to stay"
            if all(lead and lead.low > 0 for lead in leads):
                told = f"It keeps a lead over {baseline}"
            elif least.high < 0:
                told = f"It loses its lead over {baseline}"
            yield f"{cost}. {told}: {score.with_unit(least.mean, signed=True)} at least."


def _moved(score: Score, loss: Estimate) -> str:
    """``loses 1.20 dB [0.80, 1.60]``."""
    if score.number(loss.mean).startswith("-"):
        return f"gains {score.with_unit(-loss.mean)}"
    return f"loses {score.estimate(loss, unit=True)}"


def _seen(results: Results, here: list[list[Point]]) -> Iterator[str]:
    """Which methods are above the baseline, by their intervals, for an eye whose pupil is at each place."""
    score, baseline = results.headline, str(results.baseline)
    pupils = [point for points in here for point in points if point.kind == "eye_pupil" and not point.is_before]
    leads = ((point.value, (point, point.lead)) for point in pupils if point.lead and float(point.value))
    for place, rivals in grouped(leads).items():
        ranked = sorted(rivals, key=lambda rival: -rival[1].mean)
        above, (best, lead) = sum(lead.low > 0 for _, lead in ranked), ranked[0]
        gray = f", where {baseline} is no better than gray" * is_gray(results, baseline, best.condition)
        counts = f"{above or 'none'} of {len(ranked)} beat {baseline}; best {best.method}, {difference(score, lead)}"
        yield f"Pupil {place} iris radii off axis{gray}: {counts}."


def _ranges(results: Results, here: list[list[Point]]) -> Iterator[str]:
    """How far a lens moves the picture for a small loss."""
    lenses = [points for points in here if points[0].kind == "refocus" and results.headline.unit == "dB"]
    ranges = grouped((reach, points[0].method) for points in lenses if (reach := small_range(points)))
    if ranges:
        each = [f"{reach} with {words(labels)}" for reach, labels in ranges.items()]
        yield f"A lens moves the picture at a loss of {SMALL:g} {results.headline.unit} at most: {'; '.join(each)}."


def small_range(points: list[Point]) -> str | None:
    """The numbers around the nominal one up to which the mean changes by at most ``SMALL``, with their unit:
    ``-5 or less to 2 mm`` where nothing below -5 was tested; ``nowhere``. None where the next one has no score."""
    start, ends = [point.is_before for point in points].index(True), list[float]()
    for unchanged, *others in (points[start::-1], points[start:]):
        end = unchanged.value
        for point in others:
            if point.loss is None:
                return None
            if abs(point.loss.mean) > SMALL:
                break
            end = point.value
        ends.append(float(end))
    low, high = ends
    tested = [float(point.value) for point in points if not point.is_before]
    less, more = " or less" * (low == min(tested)), " or more" * (high == max(tested))
    span = f"{low:g}{less} to {high:g}{more} {KINDS[points[0].kind].unit}".strip()
    return span if low < high else "nowhere"


def _recovered(results: Results, here: list[list[Point]]) -> Iterator[str]:
    """What share of a loss of the baseline each remedy gets back, from the worst to the best value."""
    own = [points for points in here if points[0].method == results.baseline and results.headline.unit == "dB"]
    known, parts = {points[0].kind: points for points in own}, list[str]()
    for kind in REMEDIES:
        if kind in known and "eye" in known:
            shares = sorted(recovered(results, known["eye"], known[kind]), key=lambda share: share.mean)
            ends = " to ".join(dict.fromkeys(map(percent, shares[:1] + shares[-1:])))
            parts += [f"{ends} % with {KINDS[kind].words}"] * bool(ends)
    if parts:
        yield f"Of the loss comes back: {'; '.join(parts)}."
    elif "eye" in known and known.keys() & {*REMEDIES}:
        losses = [point.loss for point in known["eye"] if not point.is_before]
        if all(loss and loss.mean <= SMALL for loss in losses):
            yield f"No eye costs {results.baseline} more than {SMALL:g} dB, so there is little to get back."
        else:
            yield f"What comes back of the loss of {results.baseline} is not shown."


def recovered(results: Results, eyes: list[Point], cures: list[Point]) -> list[Estimate]:
    """Share of each loss that is got back under the same value of another kind; of a loss that is small, or not clear,
    no share is told."""
    by_value = {cure.value: cure.condition for cure in cures if cure.loss}
    shares = []
    for eye, loss in _lost(eyes):
        if eye.value in by_value and loss.mean > SMALL and not loss.low <= 0:
            names = (eye.display, eye.condition, by_value[eye.value])
            before, blurred, cured = (results.values(eye.method, name) for name in names)
            shares.append(ratio_interval(cured - blurred, before - blurred, results.clusters))
    return shares


def _judged(results: Results, points: list[Point], until: float | None) -> tuple[bool, str, str]:
    """Whether a published claim of robustness holds: no mean loss above a decibel; in words, and of which change."""
    score, far = results.headline, math.inf if until is None else until
    changed = [point for point in points if not point.is_before]
    within = [point for point in changed if not (isinstance(point.value, float) and abs(point.value) > far)]
    method, change = points[0].method, points[0].change
    if not (lost := _lost(within)) or len(lost) < len(within) or score.unit != "dB":
        return False, f"cannot be judged for {method}: some points have no score.", change
    worst, loss = lost[0]
    holds = "holds" if loss.high <= SMALL else "does not hold" if loss.low > SMALL else "is not shown to hold or fail"
    text = f"{holds} for {method}: it {_moved(score, loss)} at most, with {change}, {worst.text}."
    return loss.high <= SMALL, text, change


def table(board: Board) -> Markdown | None:
    """A row a change, a column a method: the loss at the worst value, and where that is."""
    results, several = board.results, len(board.displays) > 1
    score, lines = results.headline, dict[tuple[str, str], dict[str, object]]()
    labels = dict.fromkeys(label for _, _, label in sweeps(results))
    for (display, kind, label), points in sweeps(results).items():
        line: dict[str, object] = {"change": KINDS[kind].words, **({"display": display} if several else {})}
        row = lines.setdefault((display, kind), line | dict.fromkeys(labels, "–"))
        for worst, loss in _lost(points)[:1]:
            row[label] = f"{score.number(loss.mean)} at {worst.text}"
    note = f"Loss of the mean{score.brackets} at the worst value tried, below zero a gain; {DETAILS} has the intervals."
    return blocks([table_of([*lines.values()]), note]) if lines else None


def _render(report: Report, _: Figures) -> Blocks:
    """A row a change and method: the worst value, the loss there, and what is left above the baseline."""
    results, rows = report.results, []
    score, baseline = results.headline, results.baseline
    for points in sweeps(results).values():
        for worst, loss in _lost(points)[:1]:
            online = ", solves after the change" * (results.category(worst.method) == ONLINE)
            row = {"change": worst.change, "display": worst.display}
            row |= {"method": f"{results.facts.marked(worst.method)}{online}", "worst at": worst.text}
            row |= {f"mean loss there{score.brackets}": score.estimate(loss, signed=True)}
            if baseline:
                row |= {f"above {baseline} there{score.brackets}": score.estimate(worst.lead, signed=True)}
            rows.append(row)
    return [heading("Changes"), table_of(rows)]


def figures(report: Report) -> Iterator[tuple[Path, str]]:
    """Curves of every kind of change, the one that costs most first."""
    results = report.results
    kinds = grouped((points[0].kind, point) for points in sweeps(results).values() for point in points)
    for kind, points in sorted(
        kinds.items(), key=lambda kind: -max((each.mean for _, each in _lost(kind[1])), default=0)
    ):
        path = report.figures / f"quality-sweep-{kind}.png"
        draw_sweep(path, results, pd.DataFrame(points), f"{results.headline.axis}{report.results.text.axis}")
        yield (
            path,
            f"{results.headline.axis} along a change: {points[0].change}. Mean over targets; bars, slightly offset: "
            "95 % interval of the paired mean difference to the unchanged display. Dashed: the baseline.",
        )


def _pictures(report: Report) -> Iterator[tuple[Path, str]]:
    """Rows of pictures of the target whose differences between methods are nearest to the mean, a row a method."""
    results, thumbnails, stems = report.results, report.thumbnails, slugs(report.results.conditions)
    known, swept = thumbnails.targets(results.conditions[0]), sweeps(results)
    if not known:
        return
    target = next(name for name in results.near if name in known)
    for display, kind in dict.fromkeys((display, kind) for display, kind, _ in swept):
        ranked = results.ranking(display, categories=(*OFFLINE, ONLINE))
        rows = [
            (str(label), [(point.text, thumbnails.tile(str(label), point.condition, target)) for point in points])
            for label in dict.fromkeys([results.baseline, *subjects(results), *ranked])
            if (points := spread(swept.get((display, kind, str(label)), []), MOST_VALUES))
        ]
        change, path = KINDS[kind].words, report.figures / f"sweep-{kind}-{stems[display]}.jpg"
        draw_rows(path, f"{display}: {change}", (target, thumbnails.targets(display)[target]), rows[:MOST_ROWS])
        yield path, f"Captures of {target} on {display} along a change: {change}."


PARTS = (
    Part(
        35,
        applies=lambda report: applies(report.results),
        figures=lambda report: report.pictures("sweep-*.jpg", _pictures),
        details=True,
    ),
    Part(62, _render, applies=lambda report: applies(report.results), details=True),
)
