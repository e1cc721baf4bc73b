"""Ablation: which single change of the baseline method matters, and in which direction?"""

from __future__ import annotations

from collections.abc import Iterator

from ..phrases import verdict
from ..results import Results
from ..statistics import PairedTest
from ..text import grouped, words
from .kind import Kind

FEWEST = 3  # variants of the baseline method that make a study an ablation
NAMED = 3  # changes that the verdict lists with their differences


def variants(results: Results) -> list[str]:
    """The rows that are the baseline's own method with other settings; with another file it shows another's phases."""
    names, baseline = results.names, str(results.baseline)
    files = {label: params.get("file") for label, params in results.facts.methods["params"].items()}
    return [
        label
        for label in results.labels
        if label != baseline and (names.get(label), files.get(label)) == (names.get(baseline), files.get(baseline))
    ]


def _reseeded(results: Results, label: str) -> bool:
    """Whether a row is the baseline with another seed of its training, and nothing else."""
    params, own = (results.facts.of(row, "params", {}) for row in (label, str(results.baseline)))
    return {key for key in params.keys() | own.keys() if params.get(key) != own.get(key)} == {"seed"}


def _applies(results: Results) -> bool:
    return len(variants(results)) >= max(FEWEST, len(results.labels) / 2 - 1)


def verdicts(results: Results) -> Iterator[str]:
    """One a display: what lowers, raises and does not move the score, and what another seed of the training moves."""
    many = len(results.conditions) > 1
    for condition in results.conditions:
        tests = [test for label in variants(results) if (test := results.tested(label, condition))]
        reseeded = [test for test in tests if _reseeded(results, test.second)]
        if changes := [test for test in tests if test not in reseeded]:
            yield f"{f'{condition}: ' * many}{_changes(results, changes)}{_chance(results, reseeded)}"


def _changes(results: Results, tests: list[PairedTest]) -> str:
    score, parts = results.headline, []
    largest = sorted(tests, key=lambda test: -abs(test.estimate.mean))
    groups = grouped((verdict(score, test), test) for test in largest)
    for name, effect in (("worse", "lower"), ("better", "raise")):
        found = groups.get(name, [])
        listed = [f"{test.second} ({score.number(test.estimate.mean, signed=True)})" for test in found[:NAMED]]
        more = f" and {len(found) - NAMED} more" if len(found) > NAMED else ""
        parts.append(f"{len(found) or 'none'} {effect} it{f': {words(listed)}{more}' if found else ''}")
    return f"Of {len(tests)} changes of {results.baseline}, {'; '.join(parts)}."


def _chance(results: Results, reseeded: list[PairedTest]) -> str:
    """What another seed changes."""
    moved = [results.headline.with_unit(abs(test.estimate.mean)) for test in reseeded]
    return f" Another seed moves it by {words(moved)}: what is smaller is chance." if moved else ""


KIND = Kind(
    question="Which single change of the method matters?",
    applies=_applies,
    verdicts=verdicts,
    limits=(
        "Training: each row was trained once, and the intervals do not hold what another training of the same row "
        "would change; a row with another seed, where there is one, shows how much that is.",
    ),
)
