"""What the numbers of each display say, as sentences; none is written without its numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from ....core.errors import listed
from ...data.categories import CALIBRATED, ONLINE
from ...data.phrases import difference, margin, verdict
from ...data.results import Results
from ...data.scores import DOMAIN_NAMES
from ...data.statistics import FEWEST, SIGNIFICANCE
from ...data.text import percent, words
from ...markdown import bullets, heading
from ...section import Blocks, Figures, Report, Section


def _render(report: Report, _: Figures) -> Blocks:
    text = report.layout.text
    yield heading("Display by display")
    yield (
        f'Computed from the records of this study. The headline metric is "{report.results.headline.axis}"{text.axis}; '
        f"intervals are 95 %. {text.caution}"
    )
    for title, sentences in findings(report.results):
        yield heading(title, 3)
        yield bullets(sentences)


def findings(results: Results) -> list[tuple[str, list[str]]]:
    """The sentences of the report's summary under their headings: each display, then what holds across displays."""
    groups = [
        (
            condition,
            [
                *_best(results, condition),
                *_best_online(results, condition),
                *_second_baseline(results, condition),
                *_incomplete(results, condition),
                *_other_metrics(results, condition),
                *_oracle(results, condition),
                *_significant(results, condition),
                *_floor(results, condition, "floor_constant"),
                *_floor(results, condition, "floor_speckle"),
                *_blur_sensitivity(results, condition),
            ],
        )
        for condition in results.conditions
    ]
    across = _across_conditions(results)
    return [*groups, ("Across displays", across)] if across else groups


def _best(results: Results, condition: str) -> list[str]:
    ranking, text = results.ranking(condition), results.layout.text
    if not ranking:
        return ["No method has a score for every target, so none is ranked."]
    predicate = text.best.format(count=len(ranking)) if len(ranking) > 1 else text.only
    return _leading(results, condition, ranking, predicate, "without" if ONLINE in results.categories else "")


def _best_online(results: Results, condition: str) -> list[str]:
    """The first of the category whose methods see the camera for the scored image."""
    ranking = results.ranking(condition, categories=(ONLINE,))
    if not ranking:
        return []
    predicate = f"ranks first of {len(ranking)} methods" if len(ranking) > 1 else "is the only ranked method"
    return _leading(results, condition, ranking, f"{predicate} of the online track", "with")


def _leading(
    results: Results, condition: str, ranking: Sequence[str], predicate: str, camera: Literal["", "with", "without"]
) -> list[str]:
    """What the first of a ranking scores, and by how much it differs from the baseline (the baseline: from the next).

    predicate: what the first one does; camera: for the scored image, where that makes a difference.
    """
    score, baseline, best = results.headline, results.layout.baseline, ranking[0]
    row = results.row(best, condition)
    over = f"over {row['n']} target{'' if row['n'] == 1 else 's'}"
    seen = f", {camera} the camera for the scored image" if camera else ""
    subject = f"The baseline {best}" if best == baseline else best
    value = f"{score.in_row(row)}{f' {score.unit}' if score.unit else ''}"
    sentence = f"{subject} {predicate}{seen}: {score.title} {value} {over}."
    compared = ranking[1:2] if best == baseline else [best]
    for test in results.against_baseline:
        if test.condition == condition and test.second in compared and test.estimate.n:
            if best == baseline:
                return [f"{sentence} {test.second} follows at {margin(score, test)}."]
            other = score.with_unit(results.row(test.first, condition)[score.column])
            sentence += f" Difference from the baseline {baseline} ({other}): {margin(score, test)}."
    return [sentence + _lead(results, condition, ranking)]


def _lead(results: Results, condition: str, ranking: Sequence[str]) -> str:
    """By how much the first of a ranking is ahead of the second: the two are chosen by their scores, so untested."""
    if len(ranking) < 2 or results.layout.baseline in ranking[:2]:
        return ""
    first, second = ranking[:2]
    lead = results.estimate(results.values(first, condition) - results.values(second, condition))
    zero = ", and its interval holds zero" if lead.low <= 0 <= lead.high else ""
    apart = f"{difference(results.headline, lead)}, untested, as the two were chosen by rank{zero}"
    return f" It differs from the second, {second}, by {apart}."


def _second_baseline(results: Results, condition: str) -> list[str]:
    """Differences of all ranked methods from the study's second baseline; they are not in the family of tests."""
    second, score = results.layout.second_baseline, results.headline
    if second is None or second not in results.methods(condition) or not results.is_complete(second, condition):
        return []
    value, own = score.with_unit(results.row(second, condition)[score.column]), results.values(second, condition)
    differences = [
        f"{label} {difference(score, results.estimate(results.values(label, condition) - own))}"
        for label in results.ranking(condition)
        if label != second
    ]
    return [f"Differences from the second baseline, {second} ({value}), untested: {'; '.join(differences)}."]


def _incomplete(results: Results, condition: str) -> list[str]:
    plain = [label for label in results.methods(condition) if label not in results.layout.privileged]
    holes = [label for label in plain if not results.is_complete(label, condition)]
    counts = [f"{label} ({int(results.row(label, condition)['n'])} of {len(results.targets)})" for label in holes]
    return [f"Not ranked, because targets are missing: {listed(counts)}."] if holes else []


def _other_metrics(results: Results, condition: str) -> list[str]:
    best = results.ranking(condition)[:1]
    others: dict[str, list[str]] = {}
    for score in results.scores:
        if score.domain and not score.variant and score.key != results.headline.key:
            ranking = results.ranking(condition, score.key)
            if len(ranking) > 1 and best and ranking[0] != best[0]:
                others.setdefault(ranking[0], []).append(f"{score.title} ({DOMAIN_NAMES[score.domain]})")
    other = results.layout.text.other
    return [other.format(metrics=words(names), label=label, best=best[0]) for label, names in others.items()]


def _oracle(results: Results, condition: str) -> list[str]:
    ranking, score = results.ranking(condition), results.headline
    sentences = []
    for label in results.methods(condition):
        value = results.row(label, condition)[score.column]
        if label in results.layout.privileged and ranking and np.isfinite(value):
            gap = results.estimate(results.values(label, condition) - results.values(ranking[0], condition))
            sentences.append(
                f"The privileged method {label}, an oracle that may differentiate through the bench, scores "
                f"{score.with_unit(value)}, {difference(score, gap)} from {ranking[0]}."
            )
    for category in (CALIBRATED, ONLINE):
        best = results.ranking(condition, categories=(category,))[:1]
        closed = results.gap_closed(best[0], condition) if best else None
        if closed:
            sentences.append(
                f"{best[0]}, the best method of the {category} track, closes {percent(closed)} % of the gap "
                f"between {results.layout.baseline} and the oracle."
            )
    return sentences


def _significant(results: Results, condition: str) -> list[str]:
    tests = [test for test in results.against_baseline if test.condition == condition]
    tested = [test for test in tests if np.isfinite(test.p)]
    if not tests:
        return []
    if not tested:
        return [f"No test against the baseline: fewer than {FEWEST} clusters with complete pairs."]
    family = sum(np.isfinite(test.p) for test in results.against_baseline)
    verdicts: dict[str, list[str]] = {}
    for test in tested:
        verdicts.setdefault(verdict(results.headline, test), []).append(test.second)
    told = "; ".join(f"{found}: {words(labels)}" for found, labels in sorted(verdicts.items()))
    clusters = max(test.estimate.clusters for test in tested)
    smallest = 2.0 ** (1 - clusters)
    caution = f" With {clusters} clusters no p can be below {smallest:.2g}: no difference can be shown."
    return [
        f"Against the baseline {tested[0].first}, at p < {SIGNIFICANCE} adjusted for all {family} comparisons of the "
        f"study: {told}.{caution * (smallest >= SIGNIFICANCE)}"
    ]


def _floor(results: Results, condition: str, floor: str) -> list[str]:
    score = results.headline
    found = {label: results.above_floor(label, condition, floor) for label in results.methods(condition)}
    known = {label: estimate for label, estimate in found.items() if estimate}
    if not known:
        return []
    below = [label for label, above in known.items() if not score.better(above.mean, 0.0)]
    unclear = [label for label, above in known.items() if label not in below and not above.is_clear]
    verdicts = [f"not better on average: {words(below)}"] if below else []
    verdicts += [f"better on average, without an interval clear of zero: {words(unclear)}"] if unclear else []
    told = "; ".join(verdicts) or f"all scored methods ({len(known)}) are better"
    named, row = results.layout.text.floor_name(floor), results.row(floor, results.reference(condition))
    return [f"Floor: {named} scores {score.with_unit(row[score.column])}; {told}."]


def _blur_sensitivity(results: Results, condition: str) -> list[str]:
    keys = results.blur_scores
    rankings = {score: results.ranking(condition, score.key) for score in keys}
    plain = rankings[keys[0]] if keys else []
    if len(plain) < 2:
        return []
    flips = []
    for score, ranking in rankings.items():
        changed = [
            f"{b} above {a}"
            for index, a in enumerate(plain)
            for b in plain[index + 1 :]
            if {a, b} <= set(ranking) and ranking.index(b) < ranking.index(a)
        ]
        if changed:
            flips.append(f"at {score.blur:g} px {words(changed)}")
    widths = words([f"{score.blur:g}" for score in keys[1:]])
    if not flips:
        return [f"The order of the {len(plain)} ranked methods is the same at blur widths of {widths} px."]
    return [f"The ranking depends on the blur width: {'; '.join(flips)}."]


def _across_conditions(results: Results) -> list[str]:
    rankings = {condition: results.ranking(condition) for condition in results.conditions}
    shared = set.intersection(*(set(ranking) for ranking in rankings.values())) if rankings else set()
    if len(rankings) < 2 or len(shared) < 2:
        return []
    orders = {name: [label for label in ranking if label in shared] for name, ranking in rankings.items()}
    distinct = {tuple(order) for order in orders.values()}
    if len(distinct) == 1:
        return [f"The {len(shared)} methods ranked on every display have the same order on all {len(orders)} displays."]
    listed = "; ".join(f"{name}: {' > '.join(order)}" for name, order in orders.items())
    return [f"The order of methods depends on the display: {listed}."]


SECTIONS = (Section("findings", 10, _render, applies=lambda report: bool(report.results.conditions), details=True),)
