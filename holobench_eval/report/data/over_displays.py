"""Methods against the baseline over many displays: their margins, and what of a display goes with them.

The map is what a lab can measure of a display on its own, and what it tells of the methods on displays like it: a line
in two shares of an error budget is fitted to the margins of every method, and asked of a display that it was not fitted
to. So it is told whether the shares name the best method of a display, and what their choice costs.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...study.calibration import value_of
from ...study.calibration.family import load_family, names
from .error_budget import budgets
from .results import Results
from .statistics import FEWEST_DISPLAYS, Array, Estimate, two_way


@dataclass(frozen=True)
class Margin:
    """A method minus the baseline. values: ``(displays,)`` means over targets; over_both: their mean, with an interval
    over displays and clusters of targets together; better, worse: displays on which the family of tests shows it."""

    label: str
    values: Array
    over_both: Estimate
    better: int
    worse: int

    @property
    def median(self) -> float:
        """Over displays."""
        return float(np.median(self.values))

    @property
    def spread(self) -> tuple[float, float]:
        """The 5 and 95 % quantiles over displays."""
        low, high = np.quantile(self.values, (0.05, 0.95))
        return float(low), float(high)


def is_many(results: Results) -> bool:
    """Whether a study asks about displays and not about each: it has many, those that are a change of another aside."""
    return len(results.conditions) >= FEWEST_DISPLAYS


def applies(results: Results) -> bool:
    """Whether a study compares methods, and not only oracles, with a baseline over many displays."""
    layout = results.layout
    compared = {*layout.methods} - {*layout.privileged, layout.baseline}
    return is_many(results) and not layout.predicts and layout.baseline is not None and bool(compared)


def shown_on(results: Results) -> list[str]:
    """The displays on which every method that is compared has a score for every target."""
    rows = [label for label in results.layout.methods if label not in results.layout.privileged]
    return [name for name in results.conditions if all(results.is_complete(label, name) for label in rows)]


def margins(results: Results) -> list[Margin]:
    """Every method but the baseline and oracles, the best first."""
    where, sign = shown_on(results), results.headline.sign
    baseline = str(results.layout.baseline)
    names, index = np.unique(results.clusters, return_inverse=True)
    shares = np.eye(len(names))[index] / np.bincount(index)
    found = []
    for label in results.layout.methods if where else ():
        if label == baseline or label in results.layout.privileged:
            continue
        differences = np.stack([results.values(label, name) - results.values(baseline, name) for name in where])
        tests = [test for test in results.against_baseline if test.second == label and test.condition in where]
        better, worse = (
            sum(test.is_shown and side * sign * test.estimate.mean > 0 for test in tests) for side in (1, -1)
        )
        by_cluster = differences @ shares
        over_both = Estimate(*two_way(by_cluster), *by_cluster.shape)
        found.append(Margin(label, differences.mean(1), over_both, better, worse))
    return sorted(found, key=lambda one: -sign * one.over_both.mean)


def gains(results: Results) -> dict[str, Array]:
    """``(displays,)`` by how much each method is better than the baseline, which is the first; on ``shown_on``."""
    rows = {each.label: results.headline.sign * each.values for each in margins(results)}
    return {str(results.layout.baseline): np.zeros(len(shown_on(results))), **rows}


def winners(gained: Mapping[str, Array]) -> Counter[str]:
    """On how many displays each method is the best."""
    return Counter(list(gained)[index] for index in np.stack(list(gained.values())).argmax(0))


def published(results: Results, label: str, condition: str) -> float | None:
    """The margin of two published figures beside a display, where a method and the baseline have one."""
    names, metric = (label, str(results.layout.baseline)), results.headline.metric
    own, other = (results.layout.published(name, condition).get(metric) for name in names)
    return None if own is None or other is None else own - other


def parameters(results: Results) -> dict[str, Array]:
    """What differs between the displays of a family, ``(displays,)`` by words; empty where they are of none."""
    profiles = [results.layout.profiles[name] for name in shown_on(results) if name in results.layout.profiles]
    family = next((name for name in names() if all(one.name.startswith(f"{name}-") for one in profiles)), None)
    if family is None or len(profiles) < FEWEST_DISPLAYS:
        return {}
    loaded = load_family(family)
    values = {
        given.words: np.array([np.mean(value_of(profile, given.name)) for profile in profiles])
        for given in (*loaded.parameters, *loaded.outside.parameters)
    }
    return {words: column for words, column in values.items() if np.ptp(column) > 0}


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
    def hits(self) -> int:
        """Displays whose best method the shares name."""
        return int((self.predicted.argmax(0) == self.margins.argmax(0)).sum())

    @property
    def cost(self) -> float:
        """How far the method that the shares name stays behind the best one, over displays."""
        chosen = np.take_along_axis(self.margins, self.predicted.argmax(0)[None], 0)
        return float((self.margins.max(0) - chosen).mean())

    def always(self, label: str) -> float:
        """The same of one method."""
        return float((self.margins.max(0) - self.margins[self.labels.index(label)]).mean())

    def explained(self, label: str) -> float:
        """The share of the variance of a method's margin over displays that the lines predict (R2, leaving one out); 0
        where it does not vary."""
        row = self.labels.index(label)
        values, count = self.margins[row], self.margins.shape[1]
        others = (values.mean() - values) * count / (count - 1)  # from the mean of all displays but the one
        missed, all_others = np.square(values - self.predicted[row]).sum(), np.square(others).sum()
        return float(1 - missed / all_others) if all_others else 0.0


def display_map(results: Results) -> Map | None:
    """The map from the first error budget among the parts that has all displays; None without one."""
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


def judged(results: Results) -> dict[str, tuple[int, int]]:
    """How often control and prediction of models name the better of two methods that optimise through them.

    From the part that measured both: right ones and pairs over displays, by the title of the score.
    """
    found, told = {each.label: each for each in margins(results)}, dict[str, tuple[int, int]]()
    models = (one for one in results.related.values() if one.layout.measure == "prediction" and one.control)
    other = next(models, None)
    if other is None:
        return {}
    for score in (*other.control, other.headline):
        agree = []
        for place, name in enumerate(shown_on(results)):
            means = {
                label: other.values(label, name, score.key).mean()
                for label in other.methods(name)
                if label in found and other.is_complete(label, name, score.key)
            }
            for first, second in itertools.combinations(means, 2):
                margin = results.headline.sign * (found[first].values - found[second].values)[place]
                agree.append(bool(margin * (means[first] - means[second]) > 0))
        told[score.title] = sum(agree), len(agree)
    return told
