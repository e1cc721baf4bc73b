"""Budget: how many captures does a method need to pass the baseline, and what do more captures buy?"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from ..board import board
from ..charts.curves import draw_costs
from ..charts.look import looks
from ..facts import OFFLINE, ONLINE
from ..phrases import effect
from ..results import Results
from ..story import Report, is_many
from ..text import grouped, number, words
from .prediction import is_untestable, leader

ORDER = 90
QUESTION = "How many captures does a method need, and what do more captures buy?"
LIMITS = (
    "Captures: those of a training count once, those of solving for every target. Differences between budgets of a "
    "method are untested.",
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
    for display in board(results).displays:
        condition = display.name
        passed, failed = list[tuple[float, str]](), list[str]()
        families = _families(results, condition)
        for name, rows in families.items():
            tests = [(captures, test) for captures, label in rows if (test := results.tested(label, condition))]
            beats = [captures for captures, test in tests if effect(results.headline, test) == "better"]
            passed += [(captures, f"{name} {number(captures)}") for captures in beats[:1]]
            failed += [name] * bool(tests and not beats)
        few = [text for _, text in sorted(passed)]
        sentences = [f"Photographs that it takes to beat {baseline}: {', '.join(few)}."] * bool(few)
        sentences += [f"With no number tried: {words(failed)}."] * bool(few and failed)
        if failed and is_untestable(results):
            sentences = [f"Too few targets to test against {baseline}: {words(failed)}."]
        elif failed and not few:
            sentences = [f"No: with no number of photographs tried {words(failed)} is shown to beat {baseline}."]
        ranked = results.ranking(condition, categories=(*OFFLINE, ONLINE))
        if families and ranked:
            cost = f" with {number(_captures(results, ranked[0], condition))}" * (ranked[0] != baseline)
            begin = f"{condition}: " * (len(results.conditions) > 1)
            yield f"{begin}{' '.join([*sentences, leader(results, display, ranked, cost)])}"


def figures(report: Report) -> Iterator[tuple[Path, str]]:
    """Quality against the photographs that it cost."""
    results, path = report.results, report.figures / "quality-captures.png"
    spends = "total_captures" in results.table and bool((results.table["total_captures"] > 0).any())
    if not (spends and results.facts.spends) or results.facts.predicts or is_many(results) or results.done.empty:
        return
    axis = f"{results.headline.axis}{results.text.axis}"
    displays = [each for each in board(results).displays if any(row.photographs for row in each.rows)]
    draw_costs(path, displays, results.names, looks(results.names), axis)
    yield (
        path,
        f"{axis}, against all photographs of a row: those of its training once, and those of every target. Lines join "
        "the rows of a method. Bars: 95 % interval of the difference to the baseline.",
    )
