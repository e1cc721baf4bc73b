"""How long a run will still take, by what its rows have cost so far."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Mapping
from statistics import mean


class Remaining:
    """The time that is left for tasks of rows with costs of their own, since the longest are computed first.

    Parameters
    ----------
    rows
        Row of every task that is to be computed, and whether it runs without concurrent workers.
    known
        Seconds of a row's solution, where they were measured in an earlier run. What tasks cost beyond it, as they are
        also photographed and scored, is added as soon as this run has shown it.
    workers
        Tasks that are computed side by side.
    clock
        Seconds.
    """

    def __init__(
        self,
        rows: Iterable[tuple[str, bool]],
        known: Mapping[str, float],
        workers: int,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._waiting = Counter(rows)
        self._known, self._workers, self._clock = known, workers, clock
        self._begun: dict[Hashable, tuple[str, float, bool]] = {}
        self._count = 0
        self._first: dict[str, list[float]] = {}
        self._taken: dict[str, list[float]] = {}

    def begins(self, task: Hashable, row: str, alone: bool) -> None:
        """A worker takes up a task, named in any way."""
        self._waiting[row, alone] -= 1
        self._begun[task] = row, self._clock(), self._count < self._workers
        self._count += 1

    def ends(self, task: Hashable) -> None:
        """A task that began has ended."""
        row, begun, first = self._begun.pop(task)
        (self._first if first else self._taken).setdefault(row, []).append(self._clock() - begun)

    def seconds(self) -> float | None:
        """The time left [s]; None while nothing is known of any cost. Any thread may ask while others count."""
        costs = self._costs()
        if costs is None:
            return None
        now, waiting = self._clock(), list(self._waiting.items())
        at_work = [max(0.0, costs(row) - (now - begun)) for row, begun, _ in list(self._begun.values())]
        shared = sum(costs(row) * count for (row, alone), count in waiting if not alone) + sum(at_work)
        by_itself = sum(costs(row) * count for (row, alone), count in waiting if alone)
        return max(shared / max(self._workers, len(at_work)), *at_work, 0.0) + by_itself

    def _costs(self) -> Callable[[str], float] | None:
        """Seconds of a task of any row: as in this run, else as known and what is added, else a mean."""
        # A worker's first task also loads libraries and registers the display: it counts where nothing else is known.
        first, seen = ({row: mean(taken) for row, taken in list(by.items())} for by in (self._first, self._taken))
        added = [seconds - self._known[row] for row, seconds in seen.items() if row in self._known]
        more = max(0.0, mean(added)) if added else 0.0
        costs = first | {row: seconds + more for row, seconds in self._known.items()} | seen
        if not costs:
            return None
        middle = mean(costs.values())
        return lambda row: costs.get(row, middle)
