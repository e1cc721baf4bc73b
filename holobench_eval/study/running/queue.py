"""What is left to do in a run, and in which order it is taken up."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator

from ..scoring.job import Job
from ..training import TrainingJob

DRAWING, DRAWING_SECONDS = "", 3.0  # the label of drawings, and about what one takes
QUICK = 1.0  # s of a job that may as well be the last one
Drawing = Callable[[], None]  # of a picture that the report needs and that needs no cell
Step = TrainingJob | Job | Drawing


class Queue:
    """The steps that are left: trainings first, since they take longest; then drawings and jobs, the longest first, a
    job as soon as what it needs is there; at the end, each by itself, the jobs that run alone, those that start from
    others last.

    missing: ids of the cells still to be computed. A job of a label of which no time is known may take longer than all
    others.
    """

    def __init__(
        self,
        trainings: Iterable[TrainingJob],
        jobs: Iterable[Job],
        missing: Iterable[str],
        drawings: Iterable[Drawing] = (),
    ) -> None:
        self._trainings, self._jobs, self._drawings = list(trainings), list(jobs), list(drawings)
        self._unready = {training.preparation.id for training in self._trainings} | set(missing)
        self._begun = dict[int, float]()
        self._expected = {DRAWING: DRAWING_SECONDS}

    def begins(self, step: Step) -> None:
        """An executor has taken a step."""
        self._begun[id(step)] = time.monotonic()

    def ends(self, step: Step, makes: Collection[str] = (), label: str | None = None) -> None:
        """A step has ended, well or not. makes: ids of what others wait for; label: whose next job takes as long."""
        taken = time.monotonic() - self._begun.pop(id(step))
        self._unready -= set(makes)
        if label is not None:
            self._expected[label] = taken

    def __iter__(self) -> Iterator[Step | None]:
        """The steps, as an executor takes them. None: all that remain wait for one that is at work."""
        yield from self._trainings
        alone, groups = list[Job](), dict[tuple[str, frozenset[str]], deque[Step]]()
        late = set[str]()  # cells of jobs that run alone
        for job in sorted(self._jobs, key=lambda job: any(cell.starts for cell, _ in job.cells)):
            if job.alone or not late.isdisjoint(_needs(job)):
                alone.append(job)
                late |= job.wanted
            else:
                groups.setdefault((job.task.label, _needs(job)), deque()).append(job)
        if self._drawings:
            groups[DRAWING, frozenset()] = deque(self._drawings)
        while groups:
            ready = [group for group in groups if self._unready.isdisjoint(group[1])]
            if not ready:
                yield None
                continue
            longest = max(ready, key=lambda group: self._weight(group[0], len(groups[group])))
            yield groups[longest].popleft()
            if not groups[longest]:
                del groups[longest]
        for job in alone:
            while self._begun:
                yield None
            yield job

    def _weight(self, label: str, left: int) -> tuple[float, int]:
        """The job of the largest weight is next. left: jobs of its label. Labels of quick jobs go through the targets
        side by side, since a process remembers what the scores need of a few targets."""
        expected = self._expected.get(label, math.inf)
        return (expected, 0) if expected > QUICK else (QUICK, left)


def _needs(job: Job) -> frozenset[str]:
    return frozenset(identity for cell, _ in job.cells for identity in (*cell.prepared, *cell.starts))
