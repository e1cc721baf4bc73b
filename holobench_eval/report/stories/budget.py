"""Budget: how many captures does a method need to pass the baseline, and what do more captures buy?"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from ..board import board
from ..charts.curves import draw_costs
from ..charts.look import looks
from ..facts import OFFLINE, ONLINE
from ..phrases import value, verdict
from ..results import Results
from ..story import Part, Report, is_many
from ..text import grouped, number, words
from . import story_of

ORDER = 90
QUESTION = "How many captures does a method need, and what do more captures buy?"
LIMITS = (
    "Captures: those of a training are counted once and those of solving for every target, so with more targets "
    "the methods that use the camera for each image cost more and the others do not. Differences between budgets "
    "of a method are untested.",
)


def applies(results: Results) -> bool:
    """Whether most rows are those of a method with different numbers of captures, beside a baseline."""
    baseline = results.baseline
    if not (baseline and results.conditions and results.facts.spends and "total_captures" in results.table):
        return False
    first = results.conditions[0]
    several = sum(map(len, _families(results, first).values()))
    return results.is_complete(baseline, first) and 2 * several > len(results.methods(first))


def _captures(results: Results, label: str, condition: str) -> float:
    return float(results.rows[label, condition]["total_captures"])


def _families(results: Results, condition: str) -> dict[str, list[tuple[float, str]]]:
    """(captures in total, row) by registered method, of methods with rows of different captures, fewest first."""
    families = grouped(
        (results.names[label], (_captures(results, label, condition), label))
        for label in results.methods(condition)
        if label not in results.facts.oracles and results.is_complete(label, condition)
    )
    return {name: sorted(rows) for name, rows in families.items() if len({captures for captures, _ in rows}) > 1}


def verdicts(results: Results) -> Iterator[str]:
    """One a display: the fewest photographs with which each method beats the baseline, who never does, and the best."""
    baseline = results.baseline
    for condition in results.conditions:
        passed, failed = list[tuple[float, str]](), list[str]()
        families = _families(results, condition)
        for name, rows in families.items():
            tests = [(captures, test) for captures, label in rows if (test := results.tested(label, condition))]
            beats = [captures for captures, test in tests if verdict(results.headline, test) == "better"]
            passed += [(captures, f"{name} {number(captures)}") for captures in beats[:1]]
            failed += [name] * bool(tests and not beats)
        if not families:
            continue
        few, never = ", ".join(text for _, text in sorted(passed)), f"; never: {words(failed)}" if failed else ""
        fewest = f"Fewest photographs, of those tried, that beat {baseline}: {few}{never}"
        none = f"With no number of photographs, of those tried, {words(list(families))} is shown to beat {baseline}"
        best = results.ranking(condition, categories=(*OFFLINE, ONLINE))[0]
        cost = number(_captures(results, best, condition))
        begin = f"{condition}: " * (len(results.conditions) > 1)
        yield f"{begin}{fewest if passed else none}. Best: {best} with {cost}, {value(results, best, condition)}."


def _drawn(report: Report, own: bool) -> bool:
    """Whether quality is drawn against captures, on the first page where that is the study's ``own`` question."""
    results = report.results
    if not results.facts.spends or results.facts.predicts or is_many(results) or results.done.empty:
        return False
    spends = "total_captures" in results.table and bool((results.table["total_captures"] > 0).any())
    return spends and own == (story_of(results).QUESTION == QUESTION)


def _costs(report: Report) -> Iterator[tuple[Path, str]]:
    """Quality against the photographs that it cost."""
    results, path = report.results, report.figures / "quality-captures.png"
    axis = f"{results.headline.axis}{results.text.axis}"
    displays = [each for each in board(results).displays if any(row.photographs for row in each.rows)]
    draw_costs(path, displays, results.names, looks(results.names), axis)
    yield (
        path,
        f"{axis}, against all photographs of a row: those of its training once, and those of every target. Lines join "
        "the rows of a method. Bars: 95 % interval of the difference to the baseline.",
    )


PARTS = (
    Part(44, applies=lambda report: _drawn(report, own=True), figures=_costs),
    Part(40, applies=lambda report: _drawn(report, own=False), figures=_costs, details=True),
)
