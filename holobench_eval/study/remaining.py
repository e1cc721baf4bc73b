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
        Seconds of a row's solution, where they were measured in an earlier run; weighted by what those rows, whose
        tasks are also photographed and scored, have cost in this run.
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
        self._begun: dict[Hashable, tuple[str, float]] = {}
        self._taken: dict[str, list[float]] = {}

    def begins(self, task: Hashable, row: str, alone: bool) -> None:
        """A worker takes up a task, named in any way."""
        self._waiting[row, alone] -= 1
        self._begun[task] = row, self._clock()

    def ends(self, task: Hashable) -> None:
        """A task that began has ended."""
        row, begun = self._begun.pop(task)
        self._taken.setdefault(row, []).append(self._clock() - begun)

    def seconds(self) -> float | None:
        """The time left [s]; None while nothing is known of any cost."""
        costs = self._costs()
        if costs is None:
            return None
        now, waiting = self._clock(), self._waiting.items()
        at_work = [max(0.0, costs(row) - (now - begun)) for row, begun in self._begun.values()]
        shared = sum(costs(row) * count for (row, alone), count in waiting if not alone) + sum(at_work)
        by_itself = sum(costs(row) * count for (row, alone), count in waiting if alone)
        return max(shared / max(self._workers, len(at_work)), *at_work, 0.0) + by_itself

    def _costs(self) -> Callable[[str], float] | None:
        """Seconds of a task of any row: as in this run, else as known, else the mean of the other rows."""
        # The first task of a worker also loads libraries.
        seen = {row: mean(taken[self._workers :] or taken) for row, taken in self._taken.items()}
        both = [row for row in seen if self._known.get(row)]
        factor = sum(seen[row] for row in both) / sum(self._known[row] for row in both) if both else 1.0
        costs = {row: seconds * factor for row, seconds in self._known.items()} | seen
        if not costs:
            return None
        middle = mean(costs.values())
        return lambda row: costs.get(row, middle)
