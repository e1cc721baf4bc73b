"""Sweeps: what does a change of the display cost each method, and where does a lead over the baseline end?"""

from __future__ import annotations

from collections.abc import Iterator

from ...core.errors import listed
from ..data.categories import OFFLINE, ONLINE
from ..data.phrases import difference
from ..data.results import Results
from ..data.statistics import Estimate
from ..data.sweeps import SMALL, Sweep, sweeps
from ..data.text import percent, words
from ..markdown import Markdown, table
from .kind import Kind, subjects

REMEDIES = {"eye": ("corrected_eye", "known_eye")}  # kinds whose changes others are meant to undo
OWN = ("refocus", "other_plane", *REMEDIES)  # kinds of which the answer tells the baseline's loss, one by one
SEEING = (*OFFLINE, ONLINE)  # all categories but that of the oracles
ALWAYS = "before any change and at both ends of each"
MOST = 3  # methods that the answer follows


def sentences(results: Results) -> Iterator[str]:
    """How far a lens moves the picture, what a remedy recovers, who leads where the question names no method, and worst
    losses and leads of those in question."""
    found = [sweep for sweep in sweeps(results) if sweep.methods]
    for kind in dict.fromkeys(sweep.swept.kind for sweep in found):
        same = [sweep for sweep in found if sweep.swept.kind == kind]
        if kind == "refocus":
            yield from _range(results, same)
            yield from _blind(results, [sweep for sweep in found if sweep.swept.kind == "other_plane"])
        if kind in OWN and results.layout.baseline:
            yield from _worst(results, same, results.layout.baseline)
        for remedy in REMEDIES.get(kind, ()):
            yield from _recovered(results, same, [sweep for sweep in found if sweep.swept.kind == remedy])
    if not subjects(results):
        yield from _leaders(results, found)
    for label in _followed(results):
        yield from _worst(results, found, label)
    yield from _leads(results, found)


def _leaders(results: Results, found: list[Sweep]) -> Iterator[str]:
    """The best of several methods before any change, and at both ends of every sweep over numbers."""
    parts = []
    for before in dict.fromkeys(sweep.swept.before for sweep in found):
        ranked, ends = results.ranking(before, categories=SEEING), dict[str, list[str]]()
        for sweep in (sweep for sweep in found if sweep.swept.before == before and sweep.kind.nominal is not None):
            for value, condition in dict.fromkeys((sweep.swept.points[0], sweep.swept.points[-1])):
                for label in results.ranking(condition, categories=SEEING)[:1]:
                    ends.setdefault(label, []).append(f"{value_text(sweep, value)} ({sweep.kind.words})")
        if len(ranked) > 1 and ends:
            others = [f"{label} at {words(places)}" for label, places in ends.items() if label != ranked[0]]
            parts.append(f"on {before} {ranked[0]} {f'before any change, {listed(others)}' if others else ALWAYS}")
    if parts:
        yield f"The best mean {results.headline.heading}: {'; '.join(parts)}."


def _followed(results: Results) -> list[str]:
    """The methods whose losses the answer tells: those of the question, else the best before the change; the baseline.

    Where the answer tells a range or a share, only those of the question.
    """
    layout, condition = results.layout, results.conditions[0]
    if set(OWN) & {swept.kind for swept in layout.sweeps}:
        return subjects(results)[:MOST]
    chosen = subjects(results) or results.ranking(condition, categories=SEEING)[:1]
    return list(dict.fromkeys([*chosen, *([layout.baseline] if layout.baseline else [])]))[:MOST]


def value_text(sweep: Sweep, value: float | str) -> str:
    """A value with its unit, as in a config."""
    return f"{f'{value:g}' if isinstance(value, float) else value} {sweep.kind.unit}".strip()


def _worst(results: Results, found: list[Sweep], label: str) -> Iterator[str]:
    """The largest mean loss of a method on every display, and how many changes cost it more than a little."""
    score, parts = results.headline, []
    for before in dict.fromkeys(sweep.swept.before for sweep in found):
        here = [sweep for sweep in found if sweep.swept.before == before and label in sweep.methods]
        losses = [(loss, sweep, value) for sweep in here if (worst := sweep.worst(label)) for value, loss in [worst]]
        if losses:
            losses.sort(key=lambda entry: -entry[0].mean)
            loss, sweep, value = losses[0]
            many = _others(results, losses)
            known, points = sum(len(sweep.losses(label)) for sweep in here), sum(len(s.swept.points) for s in here)
            parts.append(
                f"on {before} {difference(score, loss)} ({sweep.kind.words}, {value_text(sweep, value)})"
                f"{many if len(losses) > 1 else ''}"
                f"{f', of the {known} of {points} changes that have every score' if known < points else ''}"
            )
    if parts:
        yield f"The largest mean loss of {label} is {'; '.join(parts)}."


def _others(results: Results, losses: list[tuple[Estimate, Sweep, float | str]]) -> str:
    """The losses after the largest, and which kinds of change are shown to cost more than a little."""
    score = results.headline
    rest = [f"{sweep.kind.words} {difference(score, loss)}" for loss, sweep, _ in losses[1:][:MOST]]
    less = f", at most as much for {len(losses) - 1 - MOST} more kinds" if len(losses) - 1 > MOST else ""
    text = f", then {', '.join(rest)}{less}"
    if score.unit != "dB":
        return text
    shown = [sweep.kind.words for loss, sweep, _ in losses if loss.low > SMALL]
    open_ = [sweep.kind.words for loss, sweep, _ in losses if loss.low <= SMALL < loss.high]
    are = "are" if len(shown) > 1 else "is"
    text += f"; {words(shown) if shown else 'no change'} {are} shown to cost it more than {SMALL:g} dB"
    return f"{text}; more is not excluded for {words(open_)}" if open_ else text


def _leads(results: Results, found: list[Sweep]) -> Iterator[str]:
    """Where the leads over the baseline end, of the methods that have one before any change."""
    baseline, parts = results.layout.baseline, []
    for label in [label for label in _followed(results) if label != baseline]:
        for before in dict.fromkeys(sweep.swept.before for sweep in found):
            here = [sweep for sweep in found if sweep.swept.before == before and label in sweep.methods]
            lead = here[0].gain(label, before) if here else None
            if lead is None:
                continue
            own = f"{label} on {before}, {difference(results.headline, lead)} before any change"
            parts.append(f"{own}, {_ends(here, label) if lead.mean > 0 else 'which is none'}")
    if parts:
        yield f"Lead over {baseline}: {'; '.join(parts)}."


def _ends(here: list[Sweep], label: str) -> str:
    """Where a lead turns negative, or that it does nowhere, and where it is least."""
    gains: list[tuple[Estimate, Sweep, float | str]] = [
        (gain, sweep, value)
        for sweep in here
        for value, condition in sweep.swept.points
        if (gain := sweep.gain(label, condition))
    ]
    if not gains:
        return "not known after a change"
    least, sweep, value = min(gains, key=lambda entry: entry[0].mean)
    where = f"{sweep.kind.words}, {value_text(sweep, value)}"
    lost = list(dict.fromkeys(other.kind.words for gain, other, _ in gains if gain.mean <= 0))
    points = sum(len(sweep.swept.points) for sweep in here)
    every = "every change" if len(gains) == points else f"the {len(gains)} of {points} changes that have every score"
    if not lost:
        return f"kept on average under {every}, least at {difference(sweep.results.headline, least)} ({where})"
    return f"lost on average under some change of {words(lost)} (worst {where})"


def _range(results: Results, same: list[Sweep]) -> Iterator[str]:
    """How far a lens moves the picture for a small loss."""
    parts = []
    for sweep in same:
        ranges: dict[str, list[str]] = {}
        for label in sweep.methods:
            if reach := sweep.small_range(label):
                ranges.setdefault(reach, []).append(label)
        if ranges:
            each = [f"{text} ({words(labels)})" for text, labels in ranges.items()]
            parts.append(f"on {sweep.swept.before} {words(each)}")
    if parts:
        yield (
            f"A lens phase moves the picture, while the mean {results.headline.title} changes by at most {SMALL:g} "
            f"{results.headline.unit}, from and to: {'; '.join(parts)}."
        )


def _blind(results: Results, planes: list[Sweep]) -> Iterator[str]:
    """Displays on which a camera out of the image plane, without a lens, costs the baseline little."""
    baseline, parts = str(results.layout.baseline), []
    for sweep in planes:
        if baseline in sweep.methods and (worst := sweep.worst(baseline)) and worst[1].high < SMALL:
            loss = f"{difference(results.headline, worst[1])} at {value_text(sweep, worst[0])}"
            parts.append(f"{sweep.swept.before} ({loss})")
    if parts:
        yield (
            f"On {words(parts)} a camera out of the image plane, without a lens, costs {baseline} as little, so that "
            "the range there says nothing of a lens."
        )


def _recovered(results: Results, same: list[Sweep], remedies: list[Sweep]) -> Iterator[str]:
    """What share of a loss a remedy gets back, from the worst to the best value."""
    parts, baseline = [], str(results.layout.baseline)
    for sweep in same:
        for remedy in remedies:
            if remedy.swept.before == sweep.swept.before and baseline in sweep.methods:
                shares = sorted(sweep.recovered(baseline, remedy).items(), key=lambda entry: entry[1].mean)
                if shares:
                    each = [f"{percent(share)} % at {value}" for value, share in (shares[0], shares[-1])]
                    parts.append(f"on {sweep.swept.before} {' up to '.join(dict.fromkeys(each))}")
                else:
                    parts.append(f"none on {sweep.swept.before}, where no loss is clear and above {SMALL:g} dB")
    if any(not part.startswith("none") for part in parts):
        yield f"Of the loss of {baseline}, this share is recovered ({remedies[0].kind.words}): {'; '.join(parts)}."


def rows(results: Results) -> Markdown | None:
    """A row a change and method: the worst value, the loss there, and what is left above the baseline."""
    score, baseline = results.headline, results.layout.baseline
    lines = []
    for sweep in sweeps(results):
        for label in sweep.methods:
            if (worst := sweep.worst(label)) is None:
                continue
            value, loss = worst
            gained = sweep.gain(label, dict(sweep.swept.points)[value]) if baseline and label != baseline else None
            lines.append(
                [
                    sweep.kind.words,
                    sweep.swept.before,
                    f"{label} (online)" if results.layout.category(label) == ONLINE else results.layout.marked(label),
                    value_text(sweep, value),
                    score.estimate(loss, signed=True),
                    *([score.estimate(gained, signed=True) if gained else "–"] if baseline else []),
                ]
            )
    columns = ["change", "display", "method", "worst at", f"mean loss there{score.brackets}"]
    columns += [f"above {baseline} there{score.brackets}"] if baseline else []
    return table(columns, lines) if lines else None


KIND = Kind(
    question="What does a change of the display cost each method?",
    applies=lambda results: any(sweep.methods for sweep in sweeps(results)),
    sentences=sentences,
    table=rows,
    limits=(
        "Changes: a loss is the paired difference to the score before the change, positive where the picture got "
        "worse; methods are prepared before it, and only those that use the camera for the scored image solve after "
        "it. The models of the changes and their rates are assumed. "
        "The worst of several values is chosen by its mean, so its interval is a little optimistic.",
    ),
)
