"""Intervals and paired tests over clusters of targets: what a difference between two methods is worth.

Targets of one cluster, such as crops of one photograph, are not independent, so that clusters and not targets are what
is counted. ``docs/statistics.md`` has the coverage of the intervals, and what was tried beside them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from ...core.seeds import seed

LEVEL = 0.95
SIGNIFICANCE = 0.05
# Below this many clusters no interval and no test is given: they would look like evidence and be none.
FEWEST = 3
MOST_ENUMERATED = 15  # clusters; of more, signs are drawn
DRAWN = 20_000

Array = NDArray[np.float64]
Clusters = Sequence[str] | NDArray[np.str_]


@dataclass(frozen=True)
class Estimate:
    """A mean over ``n`` targets in ``clusters`` with its 95 % interval, NaN where there is none."""

    mean: float
    low: float
    high: float
    n: int
    clusters: int

    @property
    def is_clear(self) -> bool:
        """Whether the interval lies on one side of zero; of one comparison, not adjusted for others."""
        return self.low > 0 or self.high < 0


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


@lru_cache(maxsize=1024)
def _quantile(clusters: int) -> float:
    """Of Student's t; NaN for too few clusters."""
    return float(stats.t.ppf((1 + LEVEL) / 2, clusters - 1)) if clusters >= FEWEST else np.nan


def _products(residuals: Array) -> Array:
    """Sums of products of ``(..., clusters)`` residuals, for the degree of freedom that their mean took."""
    count = residuals.shape[-1]
    return residuals @ residuals.T * count / max(count - 1, 1)


def family_p(differences: Array, clusters: Clusters | None = None) -> Array:
    """Two-sided p values of several mean differences, adjusted for all of them: sign-flip max-t over clusters.

    If a comparison makes no difference, the sign of a cluster's differences is a coin's. One coin a cluster turns all
    comparisons together, which keeps their correlation. Each observed |t| is compared with the largest of its own and
    of all weaker ones (step-down: Westfall & Young, "Resampling-based multiple testing", 1993, algorithm 2.8).
    All signs are counted up to ``MOST_ENUMERATED`` clusters; of more, ``DRAWN`` are drawn from a fixed seed.

    differences: ``(comparisons, targets)``, NaN for a hole, which is left out. Returns ``(comparisons,)``; NaN below
    three clusters.
    """
    known = np.isfinite(differences)
    sums = _sums(np.where(known, differences, 0.0), clusters)
    # |sum of flipped sums| / norm rises with |t|, since flipping leaves the norm as it is.
    norms = np.sqrt((sums**2).sum(1, keepdims=True))
    shares = np.divide(sums, norms, out=np.zeros_like(sums), where=norms > 0)
    observed = np.abs(shares.sum(1))
    order = np.argsort(-observed, kind="stable")
    flipped = np.abs(_signs(sums.shape[1]) @ shares[order].T)
    largest = np.maximum.accumulate(flipped[:, ::-1], axis=1)[:, ::-1]  # of each comparison and all weaker ones
    p = np.full(len(differences), np.nan)
    p[order] = np.maximum.accumulate((largest >= observed[order] - 1e-9).mean(0))
    return np.where((_sums(known.astype(np.float64), clusters) > 0).sum(1) >= FEWEST, p, np.nan)


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
