"""How often intervals hold the true mean, and how often tests show a difference that is none.

``python -m tests.support.coverage`` prints the tables of the docs.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from holobench_eval.report.statistics import (
    SIGNIFICANCE,
    Estimate,
    family_p,
    mean_interval,
    ratio_interval,
    two_way,
)

Array = NDArray[np.float64]
Draw = Callable[[np.random.Generator, tuple[int, ...]], Array]

# of mean 0 and variance 1
SHAPES: dict[str, Draw] = {
    "normal": lambda rng, size: rng.normal(size=size),
    "skewed (gamma, skewness 1)": lambda rng, size: (rng.gamma(4, size=size) - 4) / 2,
    "very skewed (exponential, skewness 2)": lambda rng, size: rng.exponential(size=size) - 1,
    "heavy-tailed (t, 3 degrees of freedom)": lambda rng, size: rng.standard_t(3, size=size) / np.sqrt(3),
}
# targets in each cluster: those of ``crops``, two crops a photograph with one cluster of renderings, and few
DESIGNS = {
    "40 alone": (1,) * 40,
    "28 in 15 clusters": (2,) * 10 + (1, 1) + (2,) * 3,
    "28 alone": (1,) * 28,
    "16 alone": (1,) * 16,
    "8 alone": (1,) * 8,
    "4 alone": (1,) * 4,
}
VARIANCES = ((1, 1, 1), (4, 1, 1), (1, 4, 1), (1, 0, 1), (0, 1, 1), (0, 0, 1))  # of displays, of clusters, of the rest
FAMILIES = ((15, 1), (20, 1), (40, 1), (15, 9), (20, 9), (40, 9))  # clusters or displays, and comparisons
SHARED = 0.5  # share of the variance that the targets of a cluster have in common


def samples(shape: str, sizes: tuple[int, ...], count: int, columns: int = 1) -> tuple[Array, list[str]]:
    """``(count, columns, targets)`` values of mean 0, and the cluster of each target."""
    rng = np.random.default_rng([len(sizes), sum(sizes), list(SHAPES).index(shape)])
    index = np.repeat(np.arange(len(sizes)), sizes)
    common = SHAPES[shape](rng, (count, columns, len(sizes)))[..., index]
    if max(sizes) == 1:
        return common, [str(cluster) for cluster in index]
    own = SHAPES[shape](rng, (count, columns, len(index)))
    return np.sqrt(SHARED) * common + np.sqrt(1 - SHARED) * own, [str(cluster) for cluster in index]


def coverage(shape: str, sizes: tuple[int, ...], count: int, by_cluster: bool = True) -> float:
    """Share of the intervals that hold the true mean."""
    drawn, clusters = samples(shape, sizes, count)
    return float(np.mean([_holds(mean_interval(one[0], clusters if by_cluster else None), 0.0) for one in drawn]))


def ratio_coverage(shape: str, sizes: tuple[int, ...], count: int) -> float:
    """The same of the ratio of two means, 1 and 4, of correlated values."""
    drawn, clusters = samples(shape, sizes, count, columns=2)
    found = [ratio_interval(1 + one[0] + 0.5 * one[1], 4 + one[1], clusters) for one in drawn]
    return float(np.mean([_holds(estimate, 0.25) for estimate in found]))


def _holds(estimate: Estimate, truth: float) -> bool:
    return estimate.low <= truth <= estimate.high


def two_way_coverage(
    shape: str, displays: int, clusters: int, variances: tuple[float, float, float], count: int
) -> float:
    """The same of the mean over displays and clusters of targets; variances: of displays, of clusters, of the rest."""
    rng = np.random.default_rng([displays, clusters, list(SHAPES).index(shape)])
    sizes = ((count, displays, 1), (count, 1, clusters), (count, displays, clusters))
    parts = (np.sqrt(variance) * SHAPES[shape](rng, size) for variance, size in zip(variances, sizes, strict=True))
    return float(np.mean([low <= 0 <= high for _, low, high in map(two_way, sum(parts, np.zeros(sizes[2])))]))


def false_positives(shape: str, clusters: int, comparisons: int, count: int) -> float:
    """Share of families without a difference in which one is shown; comparisons are independent, which is the worst."""
    drawn, _ = samples(shape, (1,) * clusters, count, comparisons)
    return float(np.mean([(family_p(one) < SIGNIFICANCE).any() for one in drawn]))


def main() -> None:
    """Print the tables."""
    print("| values |", " | ".join(DESIGNS), "| ratio, 40 alone |")
    print("|---|" + "---|" * (len(DESIGNS) + 1))
    for shape in SHAPES:
        found = [coverage(shape, sizes, 20_000) for sizes in DESIGNS.values()]
        found.append(ratio_coverage(shape, DESIGNS["40 alone"], 20_000))
        _row(shape, found)
    print("| displays, clusters, values |", " | ".join(map(str, VARIANCES)), "|")
    for displays in (20, 5):
        for shape in list(SHAPES)[:2]:
            found = [two_way_coverage(shape, displays, 15, variances, 10_000) for variances in VARIANCES]
            _row(f"{displays}, 15, {shape}", found)
    print("| differences |", " | ".join(f"{g} clusters, family of {m}" for g, m in FAMILIES), "|")
    for shape in list(SHAPES)[:3]:
        _row(shape, [false_positives(shape, *family, 2000) for family in FAMILIES])


def _row(name: str, shares: list[float]) -> None:
    print(f"| {name} |", " | ".join(f"{100 * share:.1f}" for share in shares), "|", flush=True)


if __name__ == "__main__":
    main()
