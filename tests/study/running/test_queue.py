"""The order in which trainings and cells are taken up."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import pytest

from holobench_eval.study.running.queue import DRAWING_SECONDS, Queue


@dataclass(frozen=True)
class FakeJob:
    """A job of a label and a number. needs: trainings; starts: other jobs."""

    name: str
    needs: tuple[str, ...] = ()
    alone: bool = False
    starts: tuple[str, ...] = ()

    wanted = property(lambda self: frozenset({self.name}))
    task = property(lambda self: SimpleNamespace(label=self.name.split()[0]))
    cells = property(lambda self: [(SimpleNamespace(prepared=self.needs, starts=self.starts), None)])


@dataclass(frozen=True)
class FakeTraining:
    name: str
    preparation = property(lambda self: SimpleNamespace(id=self.name))


JOBS: Any = [FakeJob("a", ("one",)), FakeJob("b"), FakeJob("c", ("two",)), FakeJob("d", ("one", "two"))]
TRAININGS: Any = [FakeTraining("one"), FakeTraining("two")]


class Executor:
    """Takes steps of a queue, and ends them when it is told."""

    def __init__(self, trainings: Any, jobs: Any, missing: Any = (), drawings: Any = ()) -> None:
        self.queue = Queue(trainings, jobs, missing, drawings)
        self.steps = iter(self.queue)

    def take(self) -> Any:
        if (step := next(self.steps)) is not None:
            self.queue.begins(step)
        return step

    def end(self, step: Any, label: str | None = None) -> None:
        self.queue.ends(step, step.wanted if isinstance(step, FakeJob) else {step.name}, label)

    def rest(self) -> list[Any]:
        """What is left, one after the other."""
        left = []
        for step in self.steps:
            left.append(step)
            if step is not None:
                self.queue.begins(step)
                self.queue.ends(step, step.wanted if isinstance(step, FakeJob) else ())
        return left


def test_a_cell_comes_as_soon_as_all_that_it_needs_is_learned_and_right_after_the_trainings_without_any():
    executor = Executor(TRAININGS, JOBS)
    assert [executor.take() for _ in range(4)] == [*TRAININGS, JOBS[1], None]
    executor.end(TRAININGS[1])
    assert [executor.take() for _ in range(3)] == [JOBS[2], None, None]
    executor.end(TRAININGS[0])
    assert executor.rest() == [JOBS[0], JOBS[3]]


def test_without_trainings_cells_keep_the_order_of_the_plan():
    assert Executor([], JOBS).rest() == JOBS


def test_a_job_that_is_to_be_alone_comes_last_and_only_when_nothing_is_at_work():
    first, other, last = jobs = [FakeJob("x", ("one",), alone=True), FakeJob("a"), FakeJob("y", alone=True)]
    executor = Executor(TRAININGS[:1], jobs)
    assert [executor.take() for _ in range(3)] == [TRAININGS[0], other, None]
    executor.end(other)
    assert executor.take() is None
    executor.end(TRAININGS[0])
    assert [executor.take() for _ in range(2)] == [first, None]
    executor.end(first)
    assert executor.rest() == [last]


@pytest.fixture
def lasts(monkeypatch):
    """Takes a job of an executor, which ends after some seconds."""
    clock = [0.0]
    monkeypatch.setattr("time.monotonic", lambda: clock[0])

    def lasts(executor: Executor, seconds: float) -> Any:
        job = executor.take()
        clock[0] += seconds
        executor.end(job, job.task.label)
        return job

    return lasts


def test_the_longest_job_comes_first_and_before_it_those_of_unknown_length(lasts):
    labels = ("short 1", "short 2", "short 3", "long 1", "long 2", "long 3", "new 1")
    jobs: Any = [FakeJob(label) for label in labels]
    executor = Executor([], jobs)
    found = [lasts(executor, seconds) for seconds in (1.0, 5.0, 2.0, 0.5)]
    assert found == [jobs[0], jobs[3], jobs[6], jobs[4]]  # of no label is the time known at first
    assert executor.rest() == [jobs[1], jobs[2], jobs[5]]


def test_quick_jobs_of_all_labels_go_target_by_target(lasts):
    labels = [f"{label} {target}" for label in ("quick", "long", "quicker") for target in range(3)]
    jobs = {label: FakeJob(label) for label in labels}
    executor = Executor([], list(jobs.values()))
    assert [lasts(executor, seconds).name for seconds in (0.9, 5.0, 0.1)] == ["quick 0", "long 0", "quicker 0"]
    order = ["long 1", "long 2", "quick 1", "quicker 1", "quick 2", "quicker 2"]
    assert executor.rest() == [jobs[label] for label in order]


def test_a_drawing_comes_before_the_jobs_that_are_shorter(lasts):
    jobs: Any = [FakeJob("long 1"), FakeJob("short 1"), FakeJob("long 2"), FakeJob("short 2")]
    drawing: Any = FakeTraining("drawing")
    executor = Executor([], jobs, drawings=[drawing])
    assert [lasts(executor, DRAWING_SECONDS + more) for more in (1, -1)] == jobs[:2]
    assert executor.rest() == [jobs[2], drawing, jobs[3]]


def test_a_job_that_starts_from_others_waits_for_them():
    oracle, a, b = jobs = [FakeJob("oracle", starts=("a", "b")), FakeJob("a"), FakeJob("b")]
    executor = Executor([], jobs, {"a", "b", "oracle"})
    assert [executor.take() for _ in range(3)] == [a, b, None]
    executor.end(a)
    assert executor.take() is None
    executor.end(b)
    assert executor.rest() == [oracle]


def test_a_job_that_starts_from_one_that_runs_alone_comes_after_it():
    jobs: Any = [FakeJob("oracle", starts=("a",)), FakeJob("a", alone=True), FakeJob("b")]
    assert Executor([], jobs, {"a", "oracle"}).rest() == [jobs[2], jobs[1], jobs[0]]
