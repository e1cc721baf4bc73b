"""Methods against the baseline over many displays: their margins, and what of a display goes with them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...study.calibration import value_of
from ...study.calibration.family import load_family, names
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
        found.append(Margin(label, differences.mean(1), _over_both(differences @ shares), better, worse))
    return sorted(found, key=lambda one: -sign * one.over_both.mean)


def gains(results: Results) -> dict[str, Array]:
    """``(displays,)`` by how much each method is better than the baseline, which is the first; on ``shown_on``."""
    rows = {each.label: results.headline.sign * each.values for each in margins(results)}
    return {str(results.layout.baseline): np.zeros(len(shown_on(results))), **rows}


def winners(gained: Mapping[str, Array]) -> list[str]:
    """The best method on each display."""
    return [list(gained)[index] for index in np.stack(list(gained.values())).argmax(0)]


def published(results: Results, label: str) -> float | None:
    """The margin of two published figures, where a method and the baseline have one."""
    names, metric = (label, str(results.layout.baseline)), results.headline.metric
    own, other = (results.layout.published(name, results.conditions[0]).get(metric) for name in names)
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


def _over_both(differences: Array) -> Estimate:
    """Of ``(displays, clusters)``."""
    return Estimate(*two_way(differences), *differences.shape)
