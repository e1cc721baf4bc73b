"""Sweeps: what does a change of the display cost each method, and where does a lead over the baseline end?"""

from __future__ import annotations

import math
from collections.abc import Iterator

from ...study.definition import Claim
from ..data.board import Board, is_gray
from ..data.layout import OFFLINE, ONLINE
from ..data.phrases import difference
from ..data.results import Results
from ..data.sweeps import SMALL, Sweep, sweeps
from ..data.text import grouped, percent, words
from ..markdown import Markdown, table_of
from ..story import subjects
from .kind import Kind

REMEDIES = {"eye": ("corrected_eye", "known_eye")}  # kinds whose changes others are meant to undo


def verdicts(results: Results) -> Iterator[str]:
    """One a display, how far a lens moves the picture or what glasses get back, else one a method, what changes cost at
    most; then the claims of the config."""
    found = [sweep for sweep in sweeps(results) if sweep.methods]
    displays = list(dict.fromkeys(sweep.swept.before for sweep in found))
    for before in displays:
        here = [sweep for sweep in found if sweep.swept.before == before]
        named, parts = (
            f"{before}: " * (len(displays) > 1),
            [*_seen(here)] or [*_ranges(here), *_recovered(results, here)],
        )
        if parts:
            yield f"{named}{'; '.join(parts)}."
            continue
        for label in _followed(results, before):
            yield from (f"{named}{cost}." for cost in _costs(here, label))
    for sweep in found:
        if claim := sweep.swept.claim:
            yield from (_claim(sweep, label, claim) for label in subjects(results)[:1] if label in sweep.methods)


def _followed(results: Results, before: str) -> list[str]:
    """The methods of the question, and the best before the change, if there are any of those that solve before it.

    Where that is the baseline alone, also the next.
    """
    ranked = [results.ranking(before, categories=categories) for categories in (OFFLINE, (ONLINE,))]
    best, baseline = (ranked[0] or ranked[1])[:1], results.layout.baseline
    followed = list(dict.fromkeys([*subjects(results), *best]))
    others = [label for label in (*ranked[0], *ranked[1]) if label != baseline]
    return [*followed, *others[:1]] if followed == [baseline] else followed


def _costs(here: list[Sweep], label: str) -> Iterator[str]:
    """The largest mean loss of a method, and whether its lead over the baseline lasts."""
    losses = [(worst[1], sweep, worst[0]) for sweep in here if label in sweep.methods and (worst := sweep.worst(label))]
    if not losses:
        return
    loss, sweep, value = max(losses, key=lambda entry: entry[0].mean)
    score, before = sweep.results.headline, sweep.swept.before
    cost = f"{label} loses at most {difference(score, loss)} ({sweep.kind.words}, {sweep.text(value)})"
    lead, baseline = sweep.gain(label, before), sweep.results.layout.baseline
    if lead is None or label == baseline:
        yield cost
    elif lead.mean <= 0:
        yield f"{cost}, with no lead over {baseline} before ({score.with_unit(lead.mean, signed=True)})"
    else:
        gains = [gain for each in here for _, name in each.swept.points if (gain := each.gain(label, name))]
        least = min(gains, key=lambda gain: gain.mean, default=lead)
        ends = "stays" if least.mean > 0 else "is lost"
        yield f"{cost}; its lead over {baseline} {ends}, {score.with_unit(least.mean, signed=True)} at least"


def _seen(here: list[Sweep]) -> Iterator[str]:
    """Which methods are above the baseline, by their intervals, for an eye whose pupil is at each place."""
    for sweep in (sweep for sweep in here if sweep.swept.kind == "eye_pupil"):
        results, score, parts = sweep.results, sweep.results.headline, list[str]()
        baseline = str(results.layout.baseline)
        for place, name in sweep.swept.points:
            rivals = [label for label in sweep.methods if label != baseline]
            gains = {label: gain for label in rivals if (gain := sweep.gain(label, name)) is not None}
            ranked = sorted(gains, key=lambda label: -gains[label].mean)
            above = [label for label in ranked if gains[label].low > 0]
            each = [f"{label} {difference(score, gains[label])}" for label in (above or ranked)[:1]]
            each += [f"{label} {score.with_unit(gains[label].mean, signed=True)}" for label in above[1:]]
            gray = f" ({baseline} is no better than gray there)" * is_gray(results, baseline, name)
            if each:
                parts.append(f"at {place}{gray} {'' if above else 'none, at best '}{', '.join(each)}")
        if parts:
            told = "for an eye whose pupil is aside, in radii of the iris"
            yield f"above {baseline} by intervals, {told}: {'; '.join(parts)}"


def _ranges(here: list[Sweep]) -> Iterator[str]:
    """How far a lens moves the picture for a small loss."""
    for sweep in here:
        labels = sweep.methods if sweep.swept.kind == "refocus" else []
        ranges = grouped((reach, label) for label in labels if (reach := sweep.small_range(label)))
        each = [f"{text} ({words(labels)})" for text, labels in ranges.items()]
        if each:
            yield f"a lens moves the picture for at most {SMALL:g} {sweep.results.headline.unit}: {', '.join(each)}"


def _recovered(results: Results, here: list[Sweep]) -> Iterator[str]:
    """What share of a loss of the baseline each remedy gets back, from the worst to the best value."""
    baseline, kinds = str(results.layout.baseline), {sweep.swept.kind: sweep for sweep in here}
    for kind, remedies in REMEDIES.items():
        sweep = kinds.get(kind)
        for remedy in (kinds[name] for name in remedies if name in kinds and sweep):
            assert sweep is not None
            shares = sorted(sweep.recovered(baseline, remedy).values(), key=lambda share: share.mean)
            told = (
                " to ".join(dict.fromkeys(f"{percent(share)} %" for share in (shares[0], shares[-1]))) if shares else ""
            )
            yield f"{remedy.kind.words} gives back {told or 'nothing, as no eye loses more than ' + f'{SMALL:g} dB'}"


def _claim(sweep: Sweep, label: str, claim: Claim) -> str:
    """Whether a published claim of robustness holds: no mean loss above a decibel."""
    score, far = sweep.results.headline, math.inf if claim.until is None else claim.until
    points = [
        (value, name) for value, name in sweep.swept.points if not (isinstance(value, float) and abs(value) > far)
    ]
    losses = sweep.losses(label)
    if not points or any(name not in losses for _, name in points) or score.unit != "dB":
        return f'"{claim.says}" cannot be judged for {label}: some points have no score.'
    value, name = max(points, key=lambda point: losses[point[1]].mean)
    loss = losses[name]
    holds = "holds" if loss.high <= SMALL else "does not hold" if loss.low > SMALL else "is not shown to hold or fail"
    where = f"{sweep.kind.words}, {sweep.text(value)}"
    return f'"{claim.says}" {holds} for {label}: it loses at most {difference(score, loss)} ({where}).'


def rows(board: Board) -> Markdown | None:
    """A row a change and method: the worst value, the loss there, and what is left above the baseline."""
    results, lines = board.results, []
    score, baseline = results.headline, results.layout.baseline
    for sweep in sweeps(results):
        for label in sweep.methods:
            if (worst := sweep.worst(label)) is None:
                continue
            value, loss = worst
            online = ", solves after the change" * (results.layout.category(label) == ONLINE)
            line = {"change": sweep.kind.words, "display": sweep.swept.before}
            line |= {"method": f"{results.layout.marked(label)}{online}", "worst at": sweep.text(value)}
            line |= {f"mean loss there{score.brackets}": score.estimate(loss, signed=True)}
            if baseline:
                gained = sweep.gain(label, dict(sweep.swept.points)[value]) if label != baseline else None
                line |= {f"above {baseline} there{score.brackets}": score.estimate(gained, signed=True)}
            lines.append(line)
    return table_of(lines)


KIND = Kind(
    question="What does a change of the display cost each method?",
    applies=lambda results: any(sweep.methods for sweep in sweeps(results)),
    verdicts=verdicts,
    table=rows,
    limits=(
        "Changes: methods are prepared before a change, and only those with a camera at the scored picture solve after "
        "it. Models and rates of the changes are assumed. The worst of several values is chosen by its mean, so that "
        "its interval is a little optimistic. A claim holds if the interval of the largest loss ends at or below "
        f"{SMALL:g} dB, and does not if it begins above.",
    ),
)
