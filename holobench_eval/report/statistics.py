"""Intervals and paired tests over clusters of targets: what a difference between two methods is worth.

Targets of one cluster, such as crops of one photograph, are not independent, so that clusters and not targets are what
is counted. ``docs/statistics.md`` has the coverage of the intervals, and what was tried beside them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from ..core.seeds import seed

LEVEL = 0.95
SIGNIFICANCE = 0.05
POWER = 0.8
# Below this many clusters no interval and no test is given: they would look like evidence and be none.
FEWEST = 3
MOST_ENUMERATED = 15  # clusters; of more, signs are drawn
DRAWN = 20_000

LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"  # of tiers
Array = NDArray[np.float64]
Clusters = Sequence[str] | NDArray[np.str_]
FEWEST_DISPLAYS = 8  # of which a cause is looked for
CLEAR = 0.3  # share of the variance over displays that a parameter has to predict to be named as what decides


@dataclass(frozen=True)
class Estimate:
    """A mean over ``n`` targets in ``clusters`` with its 95 % interval, NaN where there is none."""

    mean: float
    low: float
    high: float
    n: int
    clusters: int

    @property
    def has_interval(self) -> bool:
        """Whether there is one."""
        return not np.isnan(self.low)

    @property
    def is_clear(self) -> bool:
        """Whether the interval lies on one side of zero; of one comparison, not adjusted for others."""
        return self.low > 0 or self.high < 0

    @property
    def reach(self) -> Array:
        """How far the interval reaches down and up, ``(2, 1)`` as bars are drawn; 0 where there is none."""
        return np.nan_to_num([[self.mean - self.low], [self.high - self.mean]])

    @property
    def detectable(self) -> float:
        """The smallest mean difference that a t test of it alone shows with a probability of ``POWER``, in size: the
        standard error times two quantiles of t (Bloom, Evaluation Review 19, 547, 1995). NaN without an interval."""
        quantiles = float(stats.t.ppf(POWER, self.clusters - 1)) / _quantile(self.clusters) + 1
        return (self.high - self.low) / 2 * quantiles


NONE = Estimate(np.nan, np.nan, np.nan, 0, 0)


def _sums(values: Array, clusters: Clusters | None) -> Array:
    """Sums over each cluster of ``(..., n)`` values, ``(..., clusters)``; without clusters each value is one."""
    if clusters is None:
        return values
    names, index = np.unique(np.asarray(clusters), return_inverse=True)
    return values @ np.eye(len(names))[index]


def mean_interval(values: Sequence[float] | Array, clusters: Clusters | None = None) -> Estimate:
    """Mean of one value per target and its interval by Student's t over clusters.

    The variance of the mean is that of the clusters' summed residuals (Liang & Zeger, Biometrika 73, 1986) with the
    factor G / (G - 1) for G clusters, and t has G - 1 degrees of freedom. For clusters of one size that is the t
    interval of the clusters' means.

    values: ``(n,)``, repeats already averaged within each target; NaN gives NaN. clusters: the cluster of each.
    """
    sample = np.asarray(values, dtype=np.float64)
    n = sample.size
    if n == 0:
        return NONE
    mean = float(sample.mean())
    residuals = _sums(sample - mean, clusters)
    half = _quantile(residuals.size) * np.sqrt(_products(residuals)) / n
    return Estimate(mean, float(mean - half), float(mean + half), n, residuals.size)


def ratio_interval(numerator: Array, denominator: Array, clusters: Clusters | None = None) -> Estimate:
    """Ratio of two means over the same targets and its interval (Fieller, J. R. Stat. Soc. B 16, 1954) over clusters.

    It holds every ratio r for which numerator - r denominator is not shown to differ from zero; there is none where the
    denominator itself is not. numerator, denominator: ``(n,)``.
    """
    above, below, n = float(numerator.mean()), float(denominator.mean()), numerator.size
    residuals = np.stack([_sums(numerator - above, clusters), _sums(denominator - below, clusters)])
    count = residuals.shape[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = float(np.divide(above, below))
        scale = (_quantile(count) / n) ** 2
    means = np.array([above, below])
    (zero, cross), (_, square) = np.outer(means, means) - scale * _products(residuals)
    if not square > 0:
        return Estimate(ratio, np.nan, np.nan, n, count)
    half = np.sqrt(max(cross**2 - square * zero, 0.0))
    return Estimate(ratio, float((cross - half) / square), float((cross + half) / square), n, count)


def two_way(differences: Array) -> tuple[float, float, float]:
    """Mean over displays and clusters of targets, and its 95 % interval for other displays and other targets.

    Both are random and crossed: every display shows every cluster. The variance of the mean is (R + C - E) / (I J),
    with the mean squares R of displays, C of clusters and E of what is left in an analysis of variance without repeats,
    and at least the larger of R / (I J) and C / (I J). Student's t has the degrees of freedom of Satterthwaite
    (Biometrics Bulletin 2, 110, 1946).

    differences: ``(I displays, J clusters)``. Returns mean, low and high; no ends below three displays or clusters.
    """
    rows, columns = differences.shape
    mean = float(differences.mean())
    of_display, of_cluster = differences.mean(1, keepdims=True), differences.mean(0, keepdims=True)
    if min(rows, columns) < FEWEST:
        return mean, np.nan, np.nan
    effects = (of_display - mean, of_cluster - mean, differences - of_display - of_cluster + mean)
    freedom = np.array([rows - 1, columns - 1, (rows - 1) * (columns - 1)])
    squares = np.array([(effect**2).mean() for effect in effects]) * rows * columns / freedom
    r, c, e = squares
    variance = max(r + c - e, r, c)
    if variance == 0:
        return mean, mean, mean
    quantile = stats.t.ppf((1 + LEVEL) / 2, variance**2 / (squares**2 / freedom).sum())
    half = quantile * np.sqrt(variance / (rows * columns))
    return mean, float(mean - half), float(mean + half)


@lru_cache(maxsize=1024)
def _quantile(clusters: int) -> float:
    """Of Student's t; NaN for too few clusters."""
    return float(stats.t.ppf((1 + LEVEL) / 2, clusters - 1)) if clusters >= FEWEST else np.nan


def _products(residuals: Array) -> Array:
    """Sums of products of ``(..., clusters)`` residuals, for the degree of freedom that their mean took."""
    count = residuals.shape[-1]
    return residuals @ residuals.T * count / max(count - 1, 1)


def family_p(differences: Array, clusters: Clusters | None = None) -> Array:
    """Two-sided p values of several mean differences, adjusted for all of them: sign-flip min-p over clusters.

    If a comparison makes no difference, the sign of a cluster's differences is a coin's. One coin a cluster turns all
    comparisons together, which keeps their correlation. Every flip has a p of its own for each comparison, by its rank
    among all flips of that comparison, so that none with heavy tails hides the others. Each observed p is compared with
    the smallest of its own comparison and of all with larger ones (step-down: Westfall & Young, "Resampling-based
    multiple testing", 1993, algorithm 2.8). Few clusters give few different p: of equal ones the larger |t| is taken
    for the smaller. All signs are counted up to ``MOST_ENUMERATED`` clusters; of more, ``DRAWN`` are drawn from a fixed
    seed.

    differences: ``(comparisons, targets)``, NaN for a hole, which is left out. Returns ``(comparisons,)``; NaN below
    three clusters.
    """
    known = np.isfinite(differences)
    sums = _sums(np.where(known, differences, 0.0), clusters)
    tested = (_sums(known.astype(np.float64), clusters) > 0).sum(1) >= FEWEST
    sums[~tested] = 0.0  # p is 1 at every flip
    # |sum of flipped sums| / norm rises with |t|, since flipping leaves the norm as it is.
    norms = np.sqrt((sums**2).sum(1, keepdims=True))
    shares = np.divide(sums, norms, out=np.zeros_like(sums), where=norms > 0)
    flipped = np.abs(_signs(sums.shape[1]) @ shares.T).round(9)
    ranks = stats.rankdata(-flipped, method="max", axis=0) - flipped / (1 + flipped.max())  # p times the count of flips
    order = np.argsort(ranks[0], kind="stable")
    smallest = np.minimum.accumulate(ranks[:, order[::-1]], axis=1)[:, ::-1]  # of each comparison and all weaker ones
    p = np.empty(len(differences))
    p[order] = np.maximum.accumulate((smallest <= ranks[0, order]).mean(0))
    return np.where(tested, p, np.nan)


def tiers(values: Array, margin: float, most: float, clusters: Clusters | None = None) -> list[str]:
    """A letter for each of some rows, from best to worst: those that nothing tells from the best of their letter.

    All pairs are one family of tests (``family_p``). Going down, the first row that a test shows to be below the best
    of a letter, and that is more than the margin below it, begins the next one: another training, or another seed,
    moves a row by less. Where a letter would hold a row that is more than ``most`` below its best, the targets are too
    few to tell rows apart, and no row has a letter; nor has any without a test.

    values: ``(rows, targets)``, best row first, without holes.
    """
    rows, means = len(values), values.mean(1) if len(values) else values
    pairs = [(first, second) for first in range(rows) for second in range(first + 1, rows)]
    if not pairs:
        return [LETTERS[0]] * rows
    adjusted = family_p(np.stack([values[i] - values[k] for i, k in pairs]), clusters)
    if np.isnan(adjusted).any():
        return [""] * rows
    p = dict(zip(pairs, adjusted, strict=True))
    best, letters = 0, [LETTERS[0]]
    for row in range(1, rows):
        apart = abs(means[best] - means[row])
        if p[best, row] < SIGNIFICANCE and apart > margin:
            best = row
            letters.append(LETTERS[(LETTERS.index(letters[-1]) + 1) % len(LETTERS)])
        elif apart > most:
            return [""] * rows
        else:
            letters.append(letters[-1])
    return letters


@lru_cache(maxsize=8)
def _signs(clusters: int) -> Array:
    """``(signs, clusters)`` of 1 and -1, the observed ones first. Turning all signs changes no |t|: the first stays."""
    if clusters <= MOST_ENUMERATED:
        flipped = np.arange(2 ** max(clusters - 1, 0))[:, None] >> np.arange(clusters) & 1
    else:
        flipped = np.random.default_rng(seed("signs of clusters", clusters)).integers(0, 2, size=(DRAWN, clusters))
        flipped[0] = 0
    return np.where(flipped, -1.0, 1.0)


@dataclass(frozen=True)
class PairedTest:
    """One comparison under one condition: ``second`` minus ``first``, target by target.

    differences: ``(targets,)``, NaN where one of the two has no score; estimate: their mean; p: adjusted for the
    family of comparisons, NaN without a test.
    """

    condition: str
    first: str
    second: str
    differences: Array
    estimate: Estimate
    p: float

    @property
    def median(self) -> float:
        """Of the differences that there are; NaN for none."""
        return float(pd.Series(self.differences).median())

    def better(self, sign: int) -> int:
        """Targets for which ``second`` is better. sign: of what is better, see ``scores.Score``."""
        return int((sign * self.differences > 0).sum())

    @property
    def is_shown(self) -> bool:
        """Whether the test shows a difference."""
        return self.p < SIGNIFICANCE


@dataclass(frozen=True)
class Cause:
    """A parameter of displays that goes with a margin. rho: Spearman's; explained: the share of the variance over
    displays that a line in it predicts of a display that it was not fitted to (R2, leaving one out; the parameter is
    chosen anew each time, so that the choice is paid for)."""

    parameter: str
    rho: float
    explained: float

    @property
    def is_clear(self) -> bool:
        """Whether it predicts enough to be named."""
        return self.explained >= CLEAR


def cause(values: Array, known: Mapping[str, Array]) -> Cause | None:
    """The parameter that goes best with ``(displays,)`` margins."""
    if not known or not np.ptp(values) or len(values) < FEWEST_DISPLAYS:
        return None
    words, columns = list(known), np.stack(list(known.values()))
    predicted, mean = np.empty_like(values), np.empty_like(values)
    for left in range(len(values)):
        kept = np.arange(len(values)) != left
        best = columns[_strongest(columns[:, kept], values[kept])]
        slope, intercept = np.polyfit(best[kept], values[kept], 1)
        predicted[left], mean[left] = slope * best[left] + intercept, values[kept].mean()
    explained = 1 - np.square(values - predicted).sum() / np.square(values - mean).sum()
    strongest = _strongest(columns, values)
    rho = float(stats.spearmanr(columns[strongest], values).statistic)
    return Cause(words[strongest], rho, float(explained))


def _strongest(columns: Array, values: Array) -> int:
    """The row that correlates best with the values; the first where nothing varies."""
    products = (columns - columns.mean(1, keepdims=True)) @ (values - values.mean())
    scales = columns.std(1) * values.std()
    return int(np.argmax(np.abs(np.divide(products, scales, out=np.zeros_like(products), where=scales > 0))))
