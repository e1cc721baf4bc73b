"""What of a display goes with the margin of a method over another: one parameter, judged on displays left out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import stats

from .statistics import Array

FEWEST_DISPLAYS = 8  # of which a cause is looked for
CLEAR = 0.3  # share of the variance over displays that a parameter has to predict to be named as what decides


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
