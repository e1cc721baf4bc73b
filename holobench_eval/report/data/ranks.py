"""Does the ranking of methods survive a change of bench? Their places over random draws of a display's parameters."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pandas as pd
from scipy import stats

from ...display.simulated.changes.draws import PARAMETERS
from ..facts import OFFLINE, Swept
from ..results import Results
from ..statistics import Array, Cause, Estimate, cause, mean_interval

# Share of the draws in which a method needs a value for every target to be ranked: a method that seldom has would take
# the draws from all others.
ENOUGH = 0.5
# Parameters that are angles over a full turn: neither end of their range is more than the other.
CIRCULAR = frozenset({"zero_phase"})


@dataclass(frozen=True)
class Pair:
    """Two methods, the nominally better one first.

    nominal, differences ``(draws,)``: by how much the first is better, in units of the headline metric.
    """

    first: str
    second: str
    nominal: float
    differences: Array

    @property
    def flips(self) -> int:
        """Draws in which the order is the other way than nominally; a tie is no order."""
        return int((np.sign(self.differences) * np.sign(self.nominal) < 0).sum())

    @property
    def flipped(self) -> Estimate:
        """Share of such draws."""
        return share(self.flips, len(self.differences))


@dataclass(frozen=True)
class Ranks:
    """The ranking of methods on a display and on the draws of it.

    Methods that see the camera for the scored image, or inside the bench, are not among those that are ranked.
    """

    swept: Swept
    results: Results

    @cached_property
    def quality(self) -> pd.DataFrame:
        """Mean headline, a column a method; a row for the nominal display, then one a draw. Turned so that larger is
        better, NaN where a target has no score."""
        results, conditions = self.results, [self.swept.before, *(name for _, name in self.swept.points)]
        labels = [label for label in results.methods(conditions[0]) if results.category(label) in OFFLINE]
        means = {label: [results.values(label, name).mean() for name in conditions] for label in labels}
        return results.headline.sign * pd.DataFrame(means, dtype=np.float64)

    @cached_property
    def methods(self) -> list[str]:
        """Those that are ranked, nominally best first: with every target nominally and in enough of the draws."""
        known = self.quality.map(np.isfinite)
        draws = known[1:]
        enough = draws.any() & (draws.sum() >= ENOUGH * draws.any(axis=1).sum())
        kept = [label for label in map(str, known) if known[label].iloc[0] and enough[label]]
        return sorted(kept, key=lambda label: -self.quality[label].iloc[0])

    @cached_property
    def used(self) -> list[int]:
        """Indices of the draws in which every ranked method has a value for every target."""
        known = np.isfinite(self.quality[self.methods][1:])
        return np.flatnonzero(known.all(axis=1)).tolist() if self.methods else []

    @property
    def exists(self) -> bool:
        """Whether there is a ranking: two methods that differ on the nominal display and in a draw."""
        return len(self.methods) > 1 and len(self.taus) > 0

    @cached_property
    def nominal(self) -> Array:
        """``(methods,)`` quality on the nominal display."""
        return self.quality[self.methods].to_numpy()[0]

    @cached_property
    def drawn(self) -> Array:
        """``(draws, methods)`` quality in the draws that are used."""
        return self.quality[self.methods].to_numpy()[1:][self.used]

    @cached_property
    def nominal_positions(self) -> Array:
        """``(methods,)`` from 1; equal means share the better place."""
        return positions(self.nominal)

    @cached_property
    def positions(self) -> Array:
        """``(draws, methods)`` from 1; equal means share the better place."""
        return positions(self.drawn)

    @cached_property
    def shares(self) -> Array:
        """``(methods, positions)`` share of draws in which a method has a place."""
        return np.stack([(self.positions == rank).mean(axis=0) for rank in range(1, len(self.methods) + 1)], axis=1)

    def first(self, label: str) -> Estimate:
        """Share of draws in which a method is first."""
        return share(int((self.positions[:, self.methods.index(label)] == 1).sum()), len(self.used))

    @cached_property
    def taus(self) -> Array:
        """Kendall's tau-b of each draw's ranking against the nominal one; without draws in which all methods tie."""
        taus = np.array([stats.kendalltau(self.nominal, row).statistic for row in self.drawn])
        return taus[np.isfinite(taus)]

    @property
    def tau(self) -> Estimate:
        """Their mean, and its interval over draws."""
        found = mean_interval(self.taus)
        return replace(found, high=min(found.high, 1.0))  # no correlation is larger

    @cached_property
    def features(self) -> dict[str, Array]:
        """``(draws,)`` of what was drawn, by words: an angle by sine and cosine, a signed one by its size, too."""
        drawn = pd.DataFrame(self.swept.drawn).iloc[self.used] if self.swept.drawn else pd.DataFrame()
        found = dict[str, Array]()
        for name, column in drawn.items():
            parameter, values = PARAMETERS[str(name)], column.to_numpy()
            if name in CIRCULAR:
                found |= {f"sine of the {parameter.words}": np.sin(values)}
                found |= {f"cosine of the {parameter.words}": np.cos(values)}
                continue
            found[parameter.words] = values
            if parameter.low < 0 < parameter.high:
                found[f"size of the {parameter.words}"] = np.abs(values)
        return found

    def cause(self, pair: Pair) -> Cause | None:
        """What the difference of a pair goes with; None for nothing that was drawn."""
        found = cause(pair.differences, self.features)
        return found if found and found.is_clear else None

    @cached_property
    def pairs(self) -> list[Pair]:
        """Every pair of ranked methods, in the order of the nominal ranking."""
        ranked = zip(self.methods, self.nominal, self.drawn.T, strict=True)
        return [
            Pair(first, second, float(nominal - other), draws - others)
            for (first, nominal, draws), (second, other, others) in itertools.combinations(ranked, 2)
        ]


def positions(quality: Array) -> Array:
    """Places from 1 along the last axis, the largest first; equal values share the better place."""
    ranks: Array = stats.rankdata(-quality, method="min", axis=-1).astype(np.float64)
    return ranks


def share(count: int, total: int) -> Estimate:
    """A share of ``total`` draws with its 95 % interval (Wilson 1927)."""
    ends = stats.binomtest(count, total).proportion_ci(0.95, method="wilson")
    return Estimate(count / total, float(ends.low), float(ends.high), total, total)


def ranks(results: Results) -> list[Ranks]:
    """The rankings of every display of which a study has draws."""
    return [Ranks(swept, results) for swept in results.facts.sweeps if swept.kind == "draw"]
