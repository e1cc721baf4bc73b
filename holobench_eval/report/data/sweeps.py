"""What a change of the display cost each method: losses, their slope, and where an advantage ends."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...display.simulated.changes import KINDS, Kind
from ..facts import Swept
from ..results import Results
from ..statistics import Estimate, ratio_interval

SMALL = 1.0  # dB; a mean loss up to this is called small, as in the acceptance test of a moved image


@dataclass(frozen=True)
class Sweep:
    """A sweep with the numbers of its study."""

    swept: Swept
    results: Results

    @property
    def kind(self) -> Kind:
        """What changes."""
        return KINDS[self.swept.kind]

    def text(self, value: float | str) -> str:
        """A value with its unit, as in a config; names have none."""
        return f"{f'{value:g}' if isinstance(value, float) else value} {self.kind.unit}".strip()

    @property
    def points(self) -> tuple[tuple[float | str, str], ...]:
        """(value, condition), by value, the unchanged display at its place; it leads as ``before`` where the values are
        no numbers."""
        if self.kind.nominal is None:
            return (("before", self.swept.before), *self.swept.points)
        numbers = [(self.kind.nominal, self.swept.before), *self.swept.points]
        return tuple(sorted(numbers, key=lambda point: float(point[0])))

    @property
    def _ways(self) -> dict[int, list[tuple[float, str]]]:
        """(value, condition) from the unchanged display down (-1) and up (1); none where the values are no numbers."""
        if self.kind.nominal is None:
            return {}
        points = [(float(value), condition) for value, condition in self.points]
        start = points.index((self.kind.nominal, self.swept.before))
        return {-1: points[start::-1], 1: points[start:]}

    @property
    def methods(self) -> list[str]:
        """Labels that were planned under every condition of the sweep."""
        rows = [self.results.methods(condition) for _, condition in self.points]
        return [label for label in rows[0] if all(label in others for others in rows)]

    def loss(self, label: str, condition: str) -> Estimate | None:
        """What the change cost, target by target, positive where the score got worse; None without a complete pair of
        rows."""
        before, after = (self.results.values(label, name) for name in (self.swept.before, condition))
        lost = self.results.headline.sign * (before - after)
        return None if np.isnan(lost).any() else self.results.estimate(lost)

    def losses(self, label: str) -> dict[str, Estimate]:
        """What every change cost, by condition; without those that lack a target."""
        losses = ((condition, self.loss(label, condition)) for _, condition in self.swept.points)
        return {condition: loss for condition, loss in losses if loss is not None}

    def worst(self, label: str) -> tuple[float | str, Estimate] | None:
        """The value that cost most, and what it cost."""
        losses = self.losses(label)
        known = [(value, losses[condition]) for value, condition in self.swept.points if condition in losses]
        return max(known, key=lambda point: point[1].mean, default=None)

    def gain(self, label: str, condition: str) -> Estimate | None:
        """Headline score above the baseline under the same change, positive where it is better."""
        gained = self.results.gain(label, condition)
        if gained is None or self.results.headline.higher_is_better:
            return gained
        return replace(gained, mean=-gained.mean, low=-gained.high, high=-gained.low)

    def small_range(self, label: str) -> str | None:
        """The values around the nominal one up to which the mean changes by at most ``SMALL``, with their unit:
        ``-5 or less to 2 mm`` where nothing below -5 was tested; ``nowhere``. None without numbers, and where the next
        value has no score."""
        losses, ends = self.losses(label), []
        for (end, _), *points in self._ways.values():
            for value, condition in points:
                if condition not in losses:
                    return None
                if abs(losses[condition].mean) > SMALL:
                    break
                end = value
            ends.append(end)
        if not ends or ends[0] == ends[1]:
            return "nowhere" if ends else None
        tested = [float(value) for value, _ in self.swept.points]
        low = f"{ends[0]:g}{' or less' * (ends[0] == min(tested))}"
        high = f"{ends[1]:g}{' or more' * (ends[1] == max(tested))}"
        return f"{low} to {high} {self.kind.unit}".strip()

    def recovered(self, label: str, remedy: Sweep) -> dict[str, Estimate]:
        """Share of each loss that is got back under the same value of another kind, by value; of a loss that is small,
        or not clear, no share is told."""
        losses = remedy.losses(label)
        shares, cures = {}, {value: name for value, name in remedy.swept.points if name in losses}
        for value, condition in self.swept.points:
            lost = self.loss(label, condition)
            if value in cures and lost is not None and lost.mean > SMALL and not lost.low <= 0:
                names = (self.swept.before, condition, cures[value])
                before, blurred, cured = (self.results.values(label, name) for name in names)
                shares[str(value)] = ratio_interval(cured - blurred, before - blurred, self.results.clusters)
        return shares


def sweeps(results: Results) -> list[Sweep]:
    """The sweeps of a study without draws, which are other benches and are asked for rankings, not for losses."""
    return [Sweep(swept, results) for swept in results.facts.sweeps if swept.kind != "draw"]
