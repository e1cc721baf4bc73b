"""Ablation: which single change of the baseline method matters, and in which direction?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..data.phrases import difference, tested, value, verdict
from ..data.results import Results
from ..data.statistics import PairedTest
from ..data.text import words
from .comparison import against_baseline, floor, rows
from .kind import Kind, subjects

FEWEST = 3  # variants of the baseline method that make a study an ablation
NAMED = 6  # changes that the answer lists with their differences


def variants(results: Results) -> list[str]:
    """The rows that are the baseline's own method with other settings; with another file it shows another's phases."""
    names, baseline = results.names, str(results.layout.baseline)
    files = {label: params.get("file") for label, params in results.layout.params.items()}
    return [
        label
        for label in results.layout.methods
        if label != baseline and (names.get(label), files.get(label)) == (names.get(baseline), files.get(baseline))
    ]


def _reseeded(results: Results, label: str) -> bool:
    """Whether a row is the baseline with another seed of its training, and nothing else."""
    params, own = (results.layout.params.get(row, {}) for row in (label, str(results.layout.baseline)))
    return {key for key in params.keys() | own.keys() if params.get(key) != own.get(key)} == {"seed"}


def _applies(results: Results) -> bool:
    return len(variants(results)) >= max(FEWEST, len(results.layout.methods) / 2 - 1)


def sentences(results: Results) -> Iterator[str]:
    """Display by display what lowers, raises and does not move the score; then the other methods."""
    for condition in results.conditions:
        tests = [test for label in variants(results) if (test := tested(results, label, condition))]
        reseeded = [test for test in tests if _reseeded(results, test.second)]
        changes = [test for test in tests if test not in reseeded]
        if changes:
            yield from _changes(results, condition, changes)
        yield from (_chance(results, test, changes) for test in reseeded)
    others = [label for label in results.layout.methods if label not in variants(results)]
    yield from (against_baseline(results, label) for label in others if label in subjects(results))
    yield from floor(results)


def _changes(results: Results, condition: str, tests: list[PairedTest]) -> Iterator[str]:
    score, baseline = results.headline, str(results.layout.baseline)
    groups: dict[str, list[PairedTest]] = {}
    for test in sorted(tests, key=lambda test: -abs(test.estimate.mean)):
        groups.setdefault(verdict(score, test), []).append(test)
    whole = f"{baseline} on {condition} ({value(results, baseline, condition)})"
    for name, effect in (("worse", "lower"), ("better", "raise")):
        found = groups.get(name, [])
        listed = [f"{test.second} ({difference(score, test.estimate)})" for test in found[:NAMED]]
        more = f", and {len(found) - NAMED} more" if len(found) > NAMED else ""
        some = f"{words(listed)}{more}" if listed else "none"
        yield f"Of {len(tests)} single changes of {whole}, those shown to {effect} the score: {some}."
    if unclear := groups.get("not shown to differ", []):
        ends = np.array([[test.estimate.low, test.estimate.high] for test in unclear])
        reach = f"{score.number(ends.min(), signed=True)} to {score.with_unit(ends.max(), signed=True)}"
        names = words([test.second for test in unclear])
        yield f"No difference is shown for the other {len(unclear)}, whose intervals reach from {reach}: {names}."
    if untested := groups.get("not tested", []):
        yield f"Not tested, for want of targets: {words([test.second for test in untested])}."


def _chance(results: Results, reseeded: PairedTest, changes: list[PairedTest]) -> str:
    """What another seed changes, and which changes are shown but no larger."""
    score = results.headline
    small = [
        test.second
        for test in changes
        if verdict(score, test) in ("better", "worse") and abs(test.estimate.mean) <= abs(reseeded.estimate.mean)
    ]
    meaning = f"so that changes of that size, {words(small)}, may be chance" if small else "less than any change shown"
    return f"A second seed of the same training differs by {difference(score, reseeded.estimate)}, {meaning}."


KIND = Kind(
    question="Which single change of the method matters?",
    applies=_applies,
    sentences=sentences,
    table=rows,
    limits=(
        "Training: each row was trained once, and the intervals do not hold what another training of the same row "
        "would change; a row with another seed, where there is one, shows how much that is.",
    ),
)
