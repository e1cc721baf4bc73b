"""Budget: how many captures does a method need to pass the baseline, and what do more captures buy?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..data.phrases import short, tested, value, verdict
from ..data.results import Results
from ..data.text import number, percent, words
from .comparison import rows
from .kind import Kind


def families(results: Results) -> dict[str, list[str]]:
    """Rows by registered method, of methods with rows of different captures in total, fewest captures first."""
    names = results.names
    condition, found = results.conditions[0], dict[str, list[str]]()
    for label in results.methods(condition):
        if label not in results.layout.privileged and results.is_complete(label, condition):
            found.setdefault(str(names[label]), []).append(label)
    return {
        name: sorted(labels, key=lambda label: _captures(results, label))
        for name, labels in found.items()
        if len({_captures(results, label) for label in labels}) > 1
    }


def _captures(results: Results, label: str) -> float:
    return float(results.row(label, results.conditions[0])["total_captures"])


def _applies(results: Results) -> bool:
    if not results.conditions or not results.layout.spends_captures or "total_captures" not in results.table:
        return False
    if not results.layout.baseline or not results.is_complete(results.layout.baseline, results.conditions[0]):
        return False
    return 2 * sum(map(len, families(results).values())) > len(results.methods(results.conditions[0]))


def sentences(results: Results) -> Iterator[str]:
    """Who passes the baseline for how many captures, who does not, what more captures buy, and the best row."""
    condition, score, baseline = results.conditions[0], results.headline, str(results.layout.baseline)
    passed, failed = [], []
    for name, labels in families(results).items():
        if not any(_is_tested(results, label) for label in labels):
            continue
        first = next((label for label in labels if _is_better(results, label)), None)
        if first is None:
            failed.append(f"{name} (up to {number(_captures(results, labels[-1]))})")
        else:
            test = tested(results, first, condition)
            assert test is not None
            passed.append(
                (_captures(results, first), f"{name} {number(_captures(results, first))}", short(score, test))
            )
    cheap = [f"{text} ({gain})" for _, text, gain in sorted(passed)]
    against = f"{baseline}, which takes no captures and has {value(results, baseline, condition)} on {condition}"
    if _captures(results, baseline) > 0:
        against = f"{baseline}, {value(results, baseline, condition)} on {condition}"
    if cheap:
        yield (
            "Smallest of the tried budgets, captures in total, with which a method is shown to be better than "
            f"{against} (fewer may do): {'; '.join(cheap)}."
        )
    if failed:
        yield f"Not shown to be better than {baseline} with any of their budgets: {words(failed)}."
    rises = [_rise(results, name, labels) for name, labels in families(results).items()]
    yield f"What more captures change ({score.axis}): {'; '.join(rises)}."
    ranking = results.ranking(condition, categories=("open loop", "calibrated", "online"))
    if ranking:
        closed = results.gap_closed(ranking[0], condition)
        share = f", {percent(closed)} % of the gap between {baseline} and the oracle" if closed else ""
        yield (
            f"The best row is {ranking[0]} with {number(_captures(results, ranking[0]))} captures, "
            f"{value(results, ranking[0], condition)}{share}."
        )


def _is_tested(results: Results, label: str) -> bool:
    test = tested(results, label, results.conditions[0])
    return test is not None and bool(np.isfinite(test.p))


def _is_better(results: Results, label: str) -> bool:
    test = tested(results, label, results.conditions[0])
    return test is not None and verdict(results.headline, test) == "better"


def _rise(results: Results, name: str, labels: list[str]) -> str:
    condition, score = results.conditions[0], results.headline
    few, many = labels[0], labels[-1]
    gain = results.estimate(results.values(many, condition) - results.values(few, condition))
    clear = "" if gain.is_clear else ", not clear of zero"
    span = f"from {number(_captures(results, few))} to {number(_captures(results, many))} captures"
    return f"{name} {score.estimate(gain, signed=True)}{clear}, {span}"


KIND = Kind(
    question="How many captures does a method need, and what do more captures buy?",
    applies=_applies,
    sentences=sentences,
    table=rows,
    limits=(
        "Captures: those of a training are counted once and those of solving for every target, so with more targets "
        "the methods that use the camera for each image cost more and the others do not. Differences between budgets "
        "of a method are untested.",
    ),
)
