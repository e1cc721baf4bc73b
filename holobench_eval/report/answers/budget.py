"""Budget: how many captures does a method need to pass the baseline, and what do more captures buy?"""

from __future__ import annotations

from collections.abc import Iterator

from ..data.phrases import short, tested, value, verdict
from ..data.results import Results
from ..data.text import number, percent, words
from .comparison import rows
from .kind import Kind


def families(results: Results, condition: str) -> dict[str, list[str]]:
    """Rows of a display by registered method, of methods with rows of different captures in total, fewest first."""
    found = dict[str, list[str]]()
    for label in results.methods(condition):
        if label not in results.layout.privileged and results.is_complete(label, condition):
            found.setdefault(str(results.names[label]), []).append(label)
    return {
        name: sorted(labels, key=lambda label: _captures(results, label, condition))
        for name, labels in found.items()
        if len({_captures(results, label, condition) for label in labels}) > 1
    }


def _captures(results: Results, label: str, condition: str) -> float:
    return float(results.row(label, condition)["total_captures"])


def _applies(results: Results) -> bool:
    if not results.conditions or not results.layout.spends_captures or "total_captures" not in results.table:
        return False
    first = results.conditions[0]
    if not results.layout.baseline or not results.is_complete(results.layout.baseline, first):
        return False
    return 2 * sum(map(len, families(results, first).values())) > len(results.methods(first))


def sentences(results: Results) -> Iterator[str]:
    """Who passes the baseline for how many captures, who does not, who is worse, what more captures buy, and the best
    row: each of these display by display."""
    many = len(results.conditions) > 1
    for alike in zip(*(_of(results, name, f" on {name}" if many else "") for name in results.conditions), strict=True):
        yield " ".join(filter(None, alike))


def _of(results: Results, condition: str, here: str) -> Iterator[str]:
    """The sentences of a display, empty where there is nothing to say; here: its name in words where there are more."""
    score, baseline = results.headline, str(results.layout.baseline)
    passed, failed, worse = [], [], []
    for name, labels in families(results, condition).items():
        verdicts = [_verdict(results, label, condition) for label in labels]
        counts = [number(_captures(results, label, condition)) for label in labels]
        below = [count for count, found in zip(counts, verdicts, strict=True) if found == "worse"]
        worse += [f"{name} with {words(below)}"] if below else []
        if "better" in verdicts:
            first = verdicts.index("better")
            test = tested(results, labels[first], condition)
            assert test is not None
            cost = _captures(results, labels[first], condition)
            passed.append((cost, f"{name} {counts[first]} ({short(score, test)})"))
        elif any(found != "not tested" for found in verdicts):
            failed.append(f"{name} (up to {counts[-1]})")
    against = value(results, baseline, condition) if baseline in results.methods(condition) else ""
    if passed and _captures(results, baseline, condition) == 0:
        against = f"which takes no captures and has {against}"
    cheap = "; ".join(text for _, text in sorted(passed))
    yield (
        "Smallest of the tried budgets, captures in total, with which a method is shown to be better than "
        f"{baseline}, {against} on {condition} (fewer may do): {cheap}."
        if passed
        else ""
    )
    yield f"Not shown to be better than {baseline}{here} with any of their budgets: {words(failed)}." if failed else ""
    yield f"Worse than {baseline}{here}, captures in total: {'; '.join(worse)}." if worse else ""
    rises = [_rise(results, name, labels, condition) for name, labels in families(results, condition).items()]
    yield f"What more captures change{here} ({score.axis}): {'; '.join(rises)}." if rises else ""
    ranking = results.ranking(condition, categories=("open loop", "calibrated", "online"))
    closed = results.gap_closed(ranking[0], condition) if ranking else None
    share = f", {percent(closed)} % of the gap between {baseline} and the oracle" if closed else ""
    yield (
        f"The best row{here} is {ranking[0]} with {number(_captures(results, ranking[0], condition))} captures, "
        f"{value(results, ranking[0], condition)}{share}."
        if ranking
        else ""
    )


def _verdict(results: Results, label: str, condition: str) -> str:
    test = tested(results, label, condition)
    return verdict(results.headline, test) if test else "not tested"


def _rise(results: Results, name: str, labels: list[str], condition: str) -> str:
    few, many = labels[0], labels[-1]
    gain = results.estimate(results.values(many, condition) - results.values(few, condition))
    clear = "" if gain.is_clear else ", not clear of zero"
    counts = (number(_captures(results, label, condition)) for label in (few, many))
    span = f"from {' to '.join(counts)} captures"
    return f"{name} {results.headline.estimate(gain, signed=True)}{clear}, {span}"


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
