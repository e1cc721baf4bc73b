"""What a run has to do, in the order in which it can be done: a cell waits only for what it depends on."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator

from .cell import work
from .job import Job
from .store import Record
from .training import TrainingJob, train

Step = TrainingJob | Job
Made = str | list[Record]
"""Of a training why it failed, empty if it did not; of a task its records."""


def step(one: Step) -> Made:
    """Carry out a training (see ``train``) or the cells of a task (see ``work``). This is what a worker runs."""
    return train(one) if isinstance(one, TrainingJob) else work(one)


def queue(
    trainings: Iterable[TrainingJob], jobs: Iterable[Job], unlearned: set[str], at_work: Collection[Step]
) -> Iterator[Step | None]:
    """Trainings first, since they take longest; then jobs, those that need nothing of ``unlearned`` before the others;
    at the end, one by one, the jobs that are to be alone.

    unlearned: ids of the preparations that are not there yet; at_work: the steps that were taken; whoever takes the
    results removes both as they come. None: all that is left waits for a step that is still at work.
    """
    yield from trainings
    every = list(jobs)
    waiting = [job for job in every if not job.alone]
    while waiting:
        ready = [job for job in waiting if unlearned.isdisjoint(_needs(job))]
        waiting = [job for job in waiting if not unlearned.isdisjoint(_needs(job))]
        yield from ready
        if not ready:
            yield None
    for job in every:
        if job.alone:
            while at_work:
                yield None
            yield job


def _needs(job: Job) -> set[str]:
    return {identity for cell, _ in job.cells for identity in cell.prepared}
