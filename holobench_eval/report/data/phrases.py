"""Rows and differences in words, with all that belongs to them.

A row of a table is marked where its method is an oracle, fell back, or learned too little; a difference has its
interval, sample and p value, and says whether it is shown.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from .column import DONE
from .results import Results
from .scores import Score
from .statistics import FEWEST, POWER, SIGNIFICANCE, Estimate, PairedTest
from .text import p_value, sample, words

CONSTANT = "floor_constant"


def difference(score: Score, estimate: Estimate) -> str:
    """``+1.20 dB [+0.80, +1.60]``."""
    return score.estimate(estimate, signed=True, unit=True)


def margin(score: Score, test: PairedTest) -> str:
    """The mean paired difference, second minus first, with its sample, its p value and whether it is shown."""
    found = test.estimate
    text = f"{difference(score, found)} over {sample(found, test.differences.size)}"
    if found.clusters < FEWEST:
        return f"{text}, too few for an interval or a test"
    return f"{text}, {p_value(test.p)}{'' if test.is_shown else ': not shown'}"


def short(score: Score, test: PairedTest) -> str:
    """``margin`` without the sample and the verdict."""
    found = difference(score, test.estimate)
    return found if np.isnan(test.p) else f"{found}, {p_value(test.p)}"


def verdict(score: Score, test: PairedTest) -> str:
    """``better``, ``worse``, ``not shown to differ`` or, without a test, ``not tested``."""
    if np.isnan(test.p):
        return "not tested"
    if not test.is_shown:
        return "not shown to differ"
    return "better" if score.better(test.estimate.mean, 0.0) else "worse"


def relation(score: Score, test: PairedTest) -> str:
    """``better than wirtinger by +1.30 dB [+0.43, +2.17], p = 0.037``."""
    found, told = verdict(score, test), short(score, test)
    if found in ("better", "worse"):
        return f"{found} than {test.first}{' by' if test.estimate.mean > 0 else ','} {told}"  # not worse by a minus
    if found == "not tested":
        return f"not tested against {test.first}, {told}"
    clusters = test.estimate.clusters
    few = f" ({clusters} clusters can show no difference)" if 2.0 ** (1 - clusters) >= SIGNIFICANCE else ""
    return f"{difference(score, test.estimate)} against {test.first}, {p_value(test.p)}, not shown{few}"


def tested(results: Results, label: str, condition: str) -> PairedTest | None:
    """The comparison of a method with the baseline on a display; None where there is no complete pair of rows."""
    if results.gain(label, condition) is None:
        return None
    return next(
        (test for test in results.against_baseline if (test.condition, test.second) == (condition, label)), None
    )


def power(score: Score, tests: Sequence[PairedTest]) -> str:
    """How large a difference some tests could have shown, each alone: one sentence, or none without a test."""
    known = [test for test in tests if np.isfinite(test.p)]
    if not known:
        return ""
    sizes = [test.estimate.detectable for test in known]
    span = dict.fromkeys((score.number(min(sizes)), score.number(max(sizes))))
    clusters = sorted({test.estimate.clusters for test in known})
    of = f" of {known[0].second}" * (len({test.second for test in known}) == 1)
    return (
        f"Alone, a comparison{of} could have shown {' to '.join(span)}{f' {score.unit}' if score.unit else ''} "
        f"({100 * POWER:.0f} % power, {words(list(map(str, clusters)))} clusters)."
    )


def turned(results: Results) -> str:
    """Where another method is first by the score beside the headline: one sentence, or none."""
    if not results.beside:
        return ""
    score, parts = results.beside[0], []
    for condition in results.conditions:
        if (ranking := results.ranking(condition)) and (by_it := results.ranking(condition, score.key)):
            ours, theirs = (score.mean_in(results.row(label, condition)) for label in (ranking[0], by_it[0]))
            parts += [f"on {condition} {by_it[0]} ({theirs} against {ours} of {ranking[0]})"] * (ours != theirs)
    return f"By {score.name} another method is first: {'; '.join(parts)}." if parts else ""


def value(results: Results, label: str, condition: str) -> str:
    """The mean of the headline with its unit: ``20.62 dB``."""
    return results.headline.with_unit(float(results.values(label, condition).mean()))


def floor_scores(results: Results, floor: str = CONSTANT) -> str:
    """What a floor image scores: ``16.20 dB``, or ``16.20 dB on A and 17.97 dB on B`` where displays have their own."""
    shown = results.by_reference
    known = {name: value(results, floor, name) for name in shown if results.is_complete(floor, name)}
    return words([f"{mean} on {words(shown[name])}" if len(shown) > 1 else mean for name, mean in known.items()])


def marked(results: Results, label: str, condition: str) -> str:
    """A method's label with what must be known of its row: an oracle, a fallback, a network that learned too little."""
    return ", ".join([results.layout.marked(label), *_marks(results, label, condition)])


def counted(results: Results, label: str, condition: str) -> str:
    """``marked``, and how many targets have a score where that is not all: for tables without a column of that."""
    scored, total = results.row(label, condition)["n"], len(results.targets)
    return f"{marked(results, label, condition)}{f', {scored:.0f} of {total} targets' * bool(scored < total)}"


def _marks(results: Results, label: str, condition: str) -> Iterator[str]:
    cells = results.cells(label, condition)
    if "fell_back" in cells and (cells["fell_back"] != "").any():
        yield "fell back to Wirtinger"
    if results.layout.measure == "prediction" and (below := _below(results, label, condition)):
        yield f"not trained to convergence: below {words(below)}"


def _below(results: Results, label: str, condition: str) -> list[str]:
    """What predicts the captures better than a trained method though it takes no training."""
    layout = results.layout
    if label not in layout.trained - layout.identities or not results.is_complete(label, condition):
        return []
    rows = [("the ideal image", name, condition) for name in layout.identities if name in results.methods(condition)]
    if CONSTANT in results.floors and results.has_pictures(condition):
        rows.insert(0, ("the constant image", CONSTANT, results.reference(condition)))
    ours, better = results.values(label, condition).mean(), results.headline.better
    return [text for text, name, where in rows if better(results.values(name, where).mean(), ours)]


def remarks(results: Results) -> list[str]:
    """A sentence for all that is odd about phases; remarks that differ in numbers alone share one."""
    if "phase_remark" not in results.frame:
        return []
    odd = results.frame[(results.frame["state"] == DONE) & (results.frame["phase_remark"] != "")]
    alike = odd["phase_remark"].str.replace(r"-?\d+\.\d+", "0", regex=True)
    sentences = []
    for (name, _), cells in odd.groupby(["label", alike], sort=False):
        displays, targets = words(list(cells["condition"].unique())), cells["target"].unique()
        others = f" and {len(targets) - 1} more" * (len(targets) > 1)
        remark = f"for {targets[0]}{others}, the phase {cells['phase_remark'].iloc[0]}"
        sentences.append(f"Check the phases of {name} on {displays}: {remark}.")
    return sentences
