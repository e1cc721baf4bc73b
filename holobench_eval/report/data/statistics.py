"""Intervals and paired tests over targets: what a difference between two methods is worth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from ...core.seeds import seed

RESAMPLES = 10_000
LEVEL = 0.95
SIGNIFICANCE = 0.05
# Below this many targets no interval and no test is given: they would look like evidence and be none.
FEWEST = 3

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Estimate:
    """A mean over ``n`` targets with its 95 % interval; ``low`` and ``high`` are NaN below three targets."""

    mean: float
    low: float
    high: float
    n: int


@lru_cache(maxsize=8)
def _resamples(n: int) -> NDArray[np.int64]:
    """``(RESAMPLES, n)`` indices. They depend on ``n`` only, so methods scored on the same targets share them."""
    return np.random.default_rng(seed("bootstrap over targets", n)).integers(0, n, size=(RESAMPLES, n))


@lru_cache(maxsize=64)
def _tail(n: int) -> float:
    """Fraction of the resampled means to leave out at either end; see ``bootstrap_mean``."""
    quantile = stats.t.ppf((1 + LEVEL) / 2, n - 1) * np.sqrt(n / (n - 1))
    return float(stats.norm.cdf(-quantile))


def bootstrap_mean(values: Sequence[float] | Array) -> Estimate:
    """Mean of one value per target and its bootstrap interval.

    Percentile bootstrap with the small-sample expansion of Hesterberg 2015 (The American Statistician 69(4), 371-386):
    the percentiles are taken at Phi(-+ sqrt(n / (n - 1)) t) with t the Student quantile, since plain percentiles are
    too narrow for the ten-odd targets of a typical study.

    values: ``(n,)``, finite, repeats already averaged within each target.
    """
    sample = np.asarray(values, dtype=np.float64)
    n = sample.size
    if n == 0:
        return Estimate(np.nan, np.nan, np.nan, 0)
    mean = float(sample.mean())
    if n < FEWEST or not np.isfinite(sample).all():
        return Estimate(mean, np.nan, np.nan, n)
    tail = _tail(n)
    low, high = np.quantile(sample[_resamples(n)].mean(axis=1), [tail, 1 - tail])
    return Estimate(mean, float(low), float(high), n)


def bootstrap_ratio(numerator: Array, denominator: Array) -> Estimate:
    """Ratio of two means over the same targets, each ``(n,)``, and its percentile interval over resampled targets, with
    the expansion of ``bootstrap_mean``."""
    n = numerator.size
    ratio = float(numerator.mean() / denominator.mean())
    if n < FEWEST:
        return Estimate(ratio, np.nan, np.nan, n)
    tail = _tail(n)
    chosen = _resamples(n)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = numerator[chosen].mean(axis=1) / denominator[chosen].mean(axis=1)
    low, high = np.quantile(ratios, [tail, 1 - tail])
    return Estimate(ratio, float(low), float(high), n)


def wilcoxon(differences: Sequence[float] | Array) -> float:
    """Exact two-sided p value of the Wilcoxon signed-rank test, ties and zeros included.

    Zero differences are dropped (Wilcoxon 1945), ties get mid-ranks, and the distribution of the rank sum over all
    2^n signs is counted exactly by dynamic programming, so no normal approximation is needed at any n.
    Returns 1.0 when every difference is zero.
    """
    # Ten decimals: equal differences of values kept at six digits must stay tied after a subtraction in binary.
    sample = np.round(np.asarray(differences, dtype=np.float64), 10)
    sample = sample[sample != 0]
    if sample.size == 0:
        return 1.0
    doubled_ranks = np.rint(2 * stats.rankdata(np.abs(sample))).astype(int)
    chance = np.zeros(int(doubled_ranks.sum()) + 1)
    chance[0] = 1.0
    for rank in doubled_ranks:
        shifted = np.zeros_like(chance)
        shifted[rank:] = chance[: chance.size - rank]
        chance = (chance + shifted) / 2
    observed = int(doubled_ranks[sample > 0].sum())
    tail = min(float(chance[: observed + 1].sum()), float(chance[observed:].sum()))
    return min(1.0, 2 * tail)


def holm(p_values: Sequence[float]) -> list[float]:
    """Holm 1979 step-down correction over one family of tests; NaN (no test made) stays NaN and is not counted."""
    p = np.asarray(p_values, dtype=np.float64)
    tested = np.flatnonzero(~np.isnan(p))
    order = tested[np.argsort(p[tested], kind="stable")]
    corrected = np.full(p.shape, np.nan)
    factors = np.arange(order.size, 0, -1)
    corrected[order] = np.minimum(1.0, np.maximum.accumulate(p[order] * factors))
    return [float(value) for value in corrected]


@dataclass(frozen=True)
class PairedTest:
    """One comparison under one condition: ``second`` minus ``first`` over the targets that both have.

    complete: targets with both values; targets: all targets of the study. ``p`` and ``p_holm`` are NaN when fewer
    than three pairs are complete.
    """

    condition: str
    first: str
    second: str
    complete: int
    targets: int
    difference: Estimate
    p: float
    p_holm: float = float("nan")


def paired_test(condition: str, first: str, second: str, values: tuple[Array, Array]) -> PairedTest:
    """Compare two methods target by target.

    values: two ``(targets,)`` arrays in the same target order; NaN where a method has no score for a target.
    Pairs with a hole are left out, and the counts say how many were complete.
    """
    reference, other = (np.asarray(value, dtype=np.float64) for value in values)
    both = np.isfinite(reference) & np.isfinite(other)
    difference = other[both] - reference[both]
    p = wilcoxon(difference) if difference.size >= FEWEST else np.nan
    return PairedTest(
        condition, first, second, int(both.sum()), int(reference.size), bootstrap_mean(difference), float(p)
    )
