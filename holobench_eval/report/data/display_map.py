"""The map: what a lab can measure of a display on its own, and what it tells of the methods on displays like it.

A line in two shares of an error budget is fitted to the margins of every method, and asked of a display that it was not
fitted to. So it is told whether the shares name the best method of a display, and what their choice costs.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from ...metrics import control
from .error_budget import budgets
from .over_displays import Margin, gains, margins, shown_on, winners
from .results import Results
from .statistics import Array


@dataclass(frozen=True)
class Map:
    """Displays by two shares of the squared error of captures, and the margins of methods on them.

    labels: of the methods, the baseline among them; axes: what explains the shares; shares: ``(displays, 2)``; margins,
    predicted: ``(methods, displays)``, the latter by the lines that were fitted to all displays but the one.
    """

    labels: tuple[str, ...]
    axes: tuple[str, str]
    shares: Array
    margins: Array
    predicted: Array

    @property
    def best(self) -> list[str]:
        """On each display."""
        return winners(dict(zip(self.labels, self.margins, strict=True)))

    @property
    def usual(self) -> str:
        """The method that is best on most displays."""
        return max(self.labels, key=self.best.count)

    @property
    def hits(self) -> int:
        """Displays whose best method the shares name."""
        return int((self.predicted.argmax(0) == self.margins.argmax(0)).sum())

    @property
    def cost(self) -> float:
        """How far the method that the shares name stays behind the best one, over displays."""
        chosen = np.take_along_axis(self.margins, self.predicted.argmax(0)[None], 0)
        return float((self.margins.max(0) - chosen).mean())

    @property
    def usual_cost(self) -> float:
        """The same of the usual method."""
        return float((self.margins.max(0) - self.margins[self.labels.index(self.usual)]).mean())

    def explained(self, label: str) -> float:
        """The share of the variance of a method's margin over displays that the lines predict (R2, leaving one out); 0
        where it does not vary."""
        row = self.labels.index(label)
        values, count = self.margins[row], self.margins.shape[1]
        others = (values.mean() - values) * count / (count - 1)  # from the mean of all displays but the one
        missed, all_others = np.square(values - self.predicted[row]).sum(), np.square(others).sum()
        return float(1 - missed / all_others) if all_others else 0.0


@dataclass(frozen=True)
class Judged:
    """How often a score of models names the better of two methods that optimise through them. right: of ``pairs``, over
    displays; score: its title."""

    score: str
    right: int
    pairs: int


def display_map(results: Results) -> Map | None:
    """The map from the first error budget among the related studies that has all displays; None without one."""
    where = shown_on(results)
    for other in results.related.values():
        known = {budget.condition: budget for budget in budgets(other)}
        if not where or not all(name in known for name in where):
            continue
        *image, field = known[where[0]].explained  # in the order of the config, the last one knows most
        shares = [[part.share.mean for part in known[name].explained] for name in where]
        axes = np.array([[sum(row[:-1]), row[-1]] for row in shares])
        gained = gains(results)
        values = np.stack(list(gained.values()))
        explained = (f"{image[-1].label} and what knows less", f"{field.label} alone")
        return Map(tuple(gained), explained, axes, values, left_out(axes, values))
    return None


def left_out(shares: Array, values: Array) -> Array:
    """``(methods, displays)`` predictions of each display from the others, by lines in ``(displays, axes)`` shares.

    Of a least-squares fit with hat matrix H, the residual of a point left out is r / (1 - h) (Allen, Technometrics 16,
    125, 1974).
    """
    design = np.column_stack([np.ones(len(shares)), shares])
    hat = design @ np.linalg.pinv(design)
    return values - (values - values @ hat) / (1 - np.diag(hat))


def judged(results: Results) -> list[Judged]:
    """What control and prediction of the models tell of their methods, from the related study that measured both."""
    found = {each.label: each for each in margins(results)}
    for other in results.related.values():
        if other.layout.measure == "prediction" and other.control:
            return [_judged(results, other, found, key) for key in (control.NAME, other.headline.key)]
    return []


def _judged(results: Results, other: Results, found: dict[str, Margin], key: str) -> Judged:
    right, pairs = 0, 0
    for place, name in enumerate(shown_on(results)):
        both = [label for label in other.methods(name) if label in found and other.is_complete(label, name, key)]
        for first, second in itertools.combinations(both, 2):
            margin = results.headline.sign * (found[first].values - found[second].values)[place]
            model = other.values(first, name, key).mean() - other.values(second, name, key).mean()
            right, pairs = right + bool(margin * model > 0), pairs + 1
    return Judged(next(score.title for score in other.scores if score.key == key), right, pairs)
