"""How long a run will still take, by what tasks of the same kind have cost so far."""

from __future__ import annotations

import itertools
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Hashable, Iterable, Mapping
from statistics import mean, median

Kind = tuple[str, str]  # the method of a task, and its display, since a method may cost more on one than on another


class Remaining:
    """The time that is left for tasks of kinds with costs of their own, since the longest are computed first.

    Parameters
    ----------
    kinds
        Kind of every task that is to be computed, and whether it runs without concurrent workers.
    known
        Seconds of a solution of a kind, where they were measured in an earlier run. What tasks cost beyond it, as they
        are also photographed and scored, is added as soon as this run has shown it.
    workers
        Tasks that are computed side by side.
    clock
        Seconds.
    """

    def __init__(
        self,
        kinds: Iterable[tuple[Kind, bool]],
        known: Mapping[Kind, float],
        workers: int,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._waiting = Counter(kinds)
        self._known, self._workers, self._clock = known, workers, clock
        self._begun: dict[Hashable, tuple[Kind, float, bool]] = {}
        self._numbers = itertools.count()
        self._first: dict[Kind, list[float]] = {}
        self._taken: dict[Kind, list[float]] = {}

    def begins(self, task: Hashable, kind: Kind, alone: bool) -> None:
        """A worker takes up a task, named in any way."""
        self._waiting[kind, alone] -= 1
        self._begun[task] = kind, self._clock(), next(self._numbers) < self._workers

    def ends(self, task: Hashable) -> None:
        """A task that began has ended."""
        kind, begun, first = self._begun.pop(task)
        (self._first if first else self._taken).setdefault(kind, []).append(self._clock() - begun)

    def seconds(self) -> float | None:
        """The time left [s], without that of methods of which no cost is known (see `is_whole`); None while nothing is
        known of any cost. Any thread may ask while others count."""
        cost = self._costs()
        if not cost:
            return None
        now, waiting = self._clock(), list(self._waiting.items())
        at_work = [max(0.0, cost.get(kind, 0.0) - (now - begun)) for kind, begun, _ in list(self._begun.values())]
        shared = sum(cost.get(kind, 0.0) * count for (kind, alone), count in waiting if not alone) + sum(at_work)
        by_itself = sum(cost.get(kind, 0.0) * count for (kind, alone), count in waiting if alone)
        return max(shared / max(self._workers, len(at_work)), *at_work, 0.0) + by_itself

    def is_whole(self) -> bool:
        """Whether some cost is known of every method that is left, so that the time left is no lower limit."""
        cost = self._costs()
        left = [kind for (kind, _), count in list(self._waiting.items()) if count > 0]
        left += [kind for kind, _, _ in list(self._begun.values())]
        return bool(cost) and cost.keys() >= set(left)

    def _costs(self) -> dict[Kind, float]:
        """Seconds of a task of a kind: as in this run, else as known and what is added, else the mean of those of its
        method on other displays; nothing for a method without any."""
        # A worker's first task also loads libraries and registers the display: it counts where nothing else is known.
        first, seen = ({kind: mean(taken) for kind, taken in list(by.items())} for by in (self._first, self._taken))
        added = [seconds - self._known[kind] for kind, seconds in seen.items() if kind in self._known]
        more = max(0.0, median(added)) if added else 0.0
        costs = first | {kind: seconds + more for kind, seconds in self._known.items()} | seen
        methods = defaultdict[str, list[float]](list)
        for (method, _), seconds in costs.items():
            methods[method].append(seconds)
        elsewhere = {kind: mean(methods[kind[0]]) for kind, _ in list(self._waiting) if kind[0] in methods}
        return elsewhere | costs
