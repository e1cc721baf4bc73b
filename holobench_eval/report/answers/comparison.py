"""Comparison of methods: is what the question names better than the baseline, and what is best on each display?"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ..data.categories import CATEGORIES, OFFLINE, ONLINE
from ..data.phrases import counted, difference, floor_scores, power, relation, tested, turned, value, verdict
from ..data.results import Results
from ..data.scores import DOMAIN_NAMES
from ..data.text import number, p_value, percent, words
from ..markdown import Markdown, blocks, table
from .kind import Kind, subjects
from .lacking import lacking


def sentences(results: Results) -> Iterator[str]:
    """The named methods against the baseline, the best on each display, the online track, the oracle, the floor."""
    yield from (sentence for label in subjects(results)[:2] if (sentence := against_baseline(results, label)))
    if not subjects(results) and len(results.conditions) == 1:
        yield from everybody(results, results.conditions[0])
    yield best(results)
    yield lacking(results)
    yield from online(results)
    yield from floor(results)
    yield from oracle(results)


def against_baseline(results: Results, label: str) -> str:
    """One sentence on a method and the baseline on every display that has both; empty where none has."""
    score, baseline = results.headline, str(results.layout.baseline)
    parts = [
        f"on {condition} {relation(score, test)} ({value(results, label, condition)} against "
        f"{value(results, baseline, condition)}{_published(results, label, condition)})"
        for condition in results.conditions
        if (test := tested(results, label, condition))
    ]
    return f"{label}: {'; '.join(parts)}." if parts else ""


def everybody(results: Results, condition: str) -> Iterator[str]:
    """Who is better than the baseline, who is worse, and of whom no difference is shown."""
    score, parts = results.headline, []
    tests = [test for label in results.layout.methods if (test := tested(results, label, condition))]
    for found in ("better", "worse", "not shown to differ"):
        said = sorted((test for test in tests if verdict(score, test) == found), key=lambda test: -test.estimate.mean)
        if said:
            parts.append(f"{found}: {words([f'{test.second} ({difference(score, test.estimate)})' for test in said])}")
    if parts:
        yield f"Against {results.layout.baseline} on {condition}, {'; '.join(parts)}."


def _published(results: Results, label: str, condition: str) -> str:
    """The published difference, where the config has the figures of both."""
    score, layout = results.headline, results.layout
    own, other = (layout.published(name, condition).get(score.metric) for name in (label, str(layout.baseline)))
    if own is None or other is None:
        return ""
    return f"; published, on other hardware and images: {score.with_unit(own - other, signed=True)}"


def best(results: Results) -> str:
    """The best mean of every display, and by how much it is above the baseline."""
    parts = [_first(results, condition) for condition in results.conditions]
    track = " without a capture of the scored image" if ONLINE in results.categories else ""
    if not any(parts):
        return ""
    score, domain = results.headline, DOMAIN_NAMES.get(results.headline.domain)
    metric = f"{score.title} ({domain})" if domain else score.title
    return f"The best mean {metric}{track}: {'; '.join(filter(None, parts))}."


def _first(results: Results, condition: str) -> str:
    ranking = results.ranking(condition, categories=OFFLINE)
    if not ranking:
        return ""
    first, score = ranking[0], results.headline
    own = f"on {condition} {first}, {value(results, first, condition)}{_among(results, ranking, condition)}"
    if first == results.layout.baseline:
        test = tested(results, ranking[1], condition) if len(ranking) > 1 else None
        return f"{own}{f', followed by {ranking[1]}, {relation(score, test)}' if test else ''}"
    test = tested(results, first, condition)
    against = f", {relation(score, test)}" if test and first not in subjects(results) else ""
    return f"{own}{_spent(results, first, condition)}{against}{_ahead(results, ranking, condition)}"


def _among(results: Results, ranking: Sequence[str], condition: str) -> str:
    """Among how many methods one is the best, where others lack a target and are not ranked."""
    rivals = [label for label in results.methods(condition) if results.layout.category(label) in OFFLINE]
    if len(rivals) == len(ranking):
        return ""
    which = "the only one" if len(ranking) == 1 else f"among the {len(ranking)}"
    return f", {which} of {len(rivals)} methods with a score for every target"


def _spent(results: Results, label: str, condition: str) -> str:
    """The captures of a method in total, where there are any."""
    if not results.layout.spends_captures or "total_captures" not in results.table:
        return ""
    captures = float(results.row(label, condition)["total_captures"])
    return f" for {number(captures)} captures in total" if captures else ""


def _ahead(results: Results, ranking: Sequence[str], condition: str) -> str:
    """By how much the first is ahead of the second, unless that is the baseline."""
    if len(ranking) < 2 or ranking[1] == results.layout.baseline:
        return ""
    ahead = results.estimate(results.values(ranking[0], condition) - results.values(ranking[1], condition))
    return f", and {difference(results.headline, ahead)} ahead of the next, {ranking[1]} (untested)"


def online(results: Results) -> Iterator[str]:
    """The best of those that see the camera for the scored image."""
    parts = []
    for condition in results.conditions:
        for label in results.ranking(condition, categories=(ONLINE,))[:1]:
            test = tested(results, label, condition)
            against = f", {relation(results.headline, test)}" if test and label not in subjects(results) else ""
            own = f"{value(results, label, condition)}{_spent(results, label, condition)}"
            parts.append(f"on {condition} {label}, {own}{against}")
    if parts:
        yield f"With captures of the scored image the best is {'; '.join(parts)}."


def floor(results: Results) -> Iterator[str]:
    """Who is not above what a constant image scores."""
    parts, known, whole = [], False, True
    for condition in results.conditions:
        above = {label: results.above_floor(label, condition) for label in results.methods(condition)}
        scored = {label: gap for label, gap in above.items() if gap and gap.n == len(results.targets)}
        known, whole = known or bool(scored), whole and len(scored) == len(above)
        below = [label for label, gap in scored.items() if not results.headline.better(gap.mean, 0.0)]
        if below:
            parts.append(f"on {condition} {words(below)}")
    scores = floor_scores(results)
    constant = f"a constant image in the place of a {results.layout.text.scored}{f' ({scores})' if scores else ''}"
    if parts:
        yield f"By {results.headline.title} no better on average than {constant}: {'; '.join(parts)}."
    elif known:
        every = "Every method" if whole else "Every method with a score for every target"
        yield f"{every} is better on average than {constant}."


def oracle(results: Results) -> Iterator[str]:
    """What an oracle reaches, and how much of the gap the best method closes."""
    parts = []
    for condition in results.conditions:
        ranking, top = results.ranking(condition), results.oracle(condition)
        if top and ranking:
            gap = results.estimate(results.values(top, condition) - results.values(ranking[0], condition))
            closed = results.gap_closed(ranking[0], condition) if ranking[0] != results.layout.baseline else None
            share = (
                f", so {ranking[0]} closes {percent(closed)} % of the gap between baseline and oracle" if closed else ""
            )
            parts.append(
                f"{value(results, top, condition)} on {condition}, {difference(results.headline, gap)} from "
                f"{ranking[0]}{share}"
            )
    if parts:
        yield f"The oracle, the best phase that was found with the bench known, has {'; '.join(parts)}."


def rows(results: Results) -> Markdown | None:
    """A row a method and display, best mean first: score, difference to the baseline, verdict, captures."""
    many, captures = len(results.conditions) > 1, "total_captures" in results.table and results.layout.spends_captures
    baseline = results.layout.baseline
    headings = ["method", *(["display"] if many else []), results.headline.heading]
    beside = [*results.beside, *results.control]
    headings += [score.name for score in beside]
    headings += [f"difference to {baseline}", "verdict"] if results.against_baseline else []
    headings += ["captures in total"] if captures else []
    lines = []
    for condition in results.conditions:
        for label in _ordered(results, condition):
            row, test = results.row(label, condition), tested(results, label, condition)
            line = [counted(results, label, condition), *([condition] if many else []), results.headline.in_row(row)]
            line += [score.mean_in(row) for score in beside]
            if results.against_baseline:
                line += (
                    _compared(results, label, condition) if test else ["baseline" if label == baseline else "–", "–"]
                )
            lines.append([*line, *([number(row["total_captures"])] if captures else [])])
    note = "Captures in total: those for the training of a method and those for all scored targets." if captures else ""
    named = [test for test in results.against_baseline if test.second in subjects(results)]
    notes = [note, turned(results), power(results.headline, named or results.against_baseline)]
    return blocks([table(headings, lines), " ".join(filter(None, notes))]) if lines else None


def _ordered(results: Results, condition: str) -> list[str]:
    """Methods with every target by their mean, then those that lack one."""
    ranking = results.ranking(condition, categories=CATEGORIES)
    return [*ranking, *(label for label in results.methods(condition) if label not in ranking)]


def _compared(results: Results, label: str, condition: str) -> list[str]:
    test = tested(results, label, condition)
    assert test is not None
    shown = verdict(results.headline, test)
    p = "" if shown == "not tested" else f", {p_value(test.p)}"
    return [results.headline.estimate(test.estimate, signed=True), f"{shown}{p}"]


KIND = Kind(
    question="Which method gives the better picture, and by how much?",
    applies=lambda results: True,
    sentences=sentences,
    table=rows,
)
