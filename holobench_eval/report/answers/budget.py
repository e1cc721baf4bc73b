"""Budget: how many captures does a method need to pass the baseline, and what do more captures buy?"""

from __future__ import annotations

from collections.abc import Iterator

from ..facts import OFFLINE, ONLINE
from ..phrases import value, verdict
from ..results import Results
from ..text import grouped, number, words
from .kind import Kind


def families(results: Results, condition: str) -> dict[str, list[str]]:
    """Rows of a display by registered method, of methods with rows of different captures in total, fewest first."""
    rows = [label for label in results.methods(condition) if label not in results.facts.oracles]
    found = grouped((str(results.names[label]), label) for label in rows if results.is_complete(label, condition))
    return {
        name: sorted(labels, key=lambda label: _captures(results, label, condition))
        for name, labels in found.items()
        if len({_captures(results, label, condition) for label in labels}) > 1
    }


def _captures(results: Results, label: str, condition: str) -> float:
    return float(results.rows[label, condition]["total_captures"])


def _applies(results: Results) -> bool:
    if not results.conditions or not results.facts.spends or "total_captures" not in results.table:
        return False
    first = results.conditions[0]
    if not results.baseline or not results.is_complete(results.baseline, first):
        return False
    return 2 * sum(map(len, families(results, first).values())) > len(results.methods(first))


def verdicts(results: Results) -> Iterator[str]:
    """One a display: the fewest photographs with which each method beats the baseline, who never does, and the best."""
    many = len(results.conditions) > 1
    for condition in results.conditions:
        if found := families(results, condition):
            yield f"{f'{condition}: ' * many}{_of(results, condition, found)}"


def _of(results: Results, condition: str, found: dict[str, list[str]]) -> str:
    passed, failed, baseline = list[tuple[float, str]](), list[str](), results.baseline
    for name, labels in found.items():
        tests = [(label, results.tested(label, condition)) for label in labels]
        beats = [label for label, test in tests if test and verdict(results.headline, test) == "better"]
        if beats:
            cost = _captures(results, beats[0], condition)
            passed.append((cost, f"{name} {number(cost)}"))
        elif any(test for _, test in tests):
            failed.append(name)
    best = results.ranking(condition, categories=(*OFFLINE, ONLINE))[0]
    most = f"{best} with {number(_captures(results, best, condition))}, {value(results, best, condition)}"
    if not passed:
        which = words(list(found))
        return f"With no number of photographs, of those tried, {which} is shown to beat {baseline}. Best: {most}."
    few = ", ".join(text for _, text in sorted(passed))
    never = f"; never: {words(failed)}" if failed else ""
    return f"Fewest photographs, of those tried, that beat {baseline}: {few}{never}. Best: {most}."


KIND = Kind(
    question="How many captures does a method need, and what do more captures buy?",
    applies=_applies,
    verdicts=verdicts,
    limits=(
        "Captures: those of a training are counted once and those of solving for every target, so with more targets "
        "the methods that use the camera for each image cost more and the others do not. Differences between budgets "
        "of a method are untested.",
    ),
)
