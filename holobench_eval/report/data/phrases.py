"""Differences in words, with all that belongs to them: interval, sample, p value, and whether a difference is shown."""

from __future__ import annotations

import numpy as np

from .results import Results
from .scores import Score
from .statistics import FEWEST, SIGNIFICANCE, Estimate, PairedTest
from .text import p_value, sample


def difference(score: Score, estimate: Estimate) -> str:
    """``+1.20 dB [+0.80, +1.60]``."""
    mean = score.with_unit(estimate.mean, signed=True)
    ends = (score.number(end, signed=True) for end in (estimate.low, estimate.high))
    return mean if np.isnan(estimate.low) else f"{mean} [{', '.join(ends)}]"


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
    few = f" ({clusters} clusters can show nothing)" if 2.0 ** (1 - clusters) >= SIGNIFICANCE else ""
    return f"{difference(score, test.estimate)} against {test.first}, {p_value(test.p)}, not shown{few}"


def tested(results: Results, label: str, condition: str) -> PairedTest | None:
    """The comparison of a method with the baseline on a display; None where there is no complete pair of rows."""
    return next(
        (
            test
            for test in results.against_baseline
            if (test.condition, test.second) == (condition, label)
            and results.is_complete(label, condition)
            and results.is_complete(test.first, condition)
        ),
        None,
    )


def value(results: Results, label: str, condition: str) -> str:
    """The mean of the headline with its unit: ``20.62 dB``."""
    return results.headline.with_unit(float(results.values(label, condition).mean()))
