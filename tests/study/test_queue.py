"""The order in which trainings and cells are taken up."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from holobench_eval.study.run import DRAWING, DRAWING_SECONDS, queue


@dataclass(frozen=True)
class FakeCell:
    prepared: tuple[str, ...]
    starts: tuple[str, ...] = ()


@dataclass(frozen=True)
class FakeJob:
    name: str
    needs: tuple[str, ...] = ()
    alone: bool = False
    starts: tuple[str, ...] = ()

    @property
    def wanted(self) -> frozenset[str]:
        return frozenset({self.name})

    @property
    def task(self) -> SimpleNamespace:
        return SimpleNamespace(label=self.name.split()[0])

    @property
    def cells(self) -> list[tuple[FakeCell, None]]:
        return [(FakeCell(self.needs, self.starts), None)]


JOBS: Any = [FakeJob("a", ("one",)), FakeJob("b"), FakeJob("c", ("two",)), FakeJob("d", ("one", "two"))]
TRAININGS: Any = ["one", "two"]


def test_cells_that_wait_for_nothing_come_right_after_the_trainings() -> None:
    steps = queue(TRAININGS, JOBS, {"one", "two"}, [], {})
    assert [next(steps) for _ in range(3)] == ["one", "two", JOBS[1]]


def test_a_cell_comes_as_soon_as_all_that_it_needs_is_learned_and_none_is_lost() -> None:
    unlearned = {"one", "two"}
    steps = queue(TRAININGS, JOBS, unlearned, [], {})
    assert [next(steps) for _ in range(3)][-1] is JOBS[1]
    assert next(steps) is None
    unlearned.discard("two")
    assert next(steps) is JOBS[2]
    assert next(steps) is None
    assert next(steps) is None
    unlearned.discard("one")
    assert list(steps) == [JOBS[0], JOBS[3]]


def test_without_trainings_cells_keep_the_order_of_the_plan() -> None:
    assert list(queue([], JOBS, set(), [], {})) == JOBS


def test_a_job_that_is_to_be_alone_comes_last_and_only_when_nothing_is_at_work() -> None:
    quiet: Any = [FakeJob("x", ("one",), alone=True), FakeJob("y", alone=True)]
    at_work: Any = ["a", "one"]
    unlearned = {"one"}
    steps = queue([], [quiet[0], FakeJob("a"), quiet[1]], unlearned, at_work, {})
    assert next(steps) == FakeJob("a")
    assert next(steps) is None
    at_work.remove("a")
    assert next(steps) is None
    at_work.remove("one")
    unlearned.remove("one")
    assert next(steps) is quiet[0]
    at_work.append("x")
    assert next(steps) is None
    at_work.remove("x")
    assert list(steps) == [quiet[1]]


def test_the_longest_job_comes_first_and_before_it_those_of_unknown_length() -> None:
    jobs: Any = [FakeJob("short 1"), FakeJob("short 2"), FakeJob("long 1"), FakeJob("long 2"), FakeJob("new 1")]
    expected = {"short": 1.0, "long": 5.0}
    steps = queue([], jobs, set(), [], expected)
    assert next(steps) is jobs[4]
    assert next(steps) is jobs[2]
    expected["long"] = 0.5
    assert list(steps) == [jobs[0], jobs[1], jobs[3]]


def test_a_drawing_comes_before_the_jobs_that_are_shorter() -> None:
    jobs: Any = [FakeJob("long"), FakeJob("short")]
    drawing: Any = "drawing"
    steps = queue([], jobs, set(), [], {"long": 5.0, "short": 1.0, DRAWING: DRAWING_SECONDS}, [drawing])
    assert list(steps) == [jobs[0], drawing, jobs[1]]


def test_a_job_that_starts_from_others_waits_for_them() -> None:
    jobs: Any = [FakeJob("oracle", starts=("a", "b")), FakeJob("a"), FakeJob("b")]
    unready = {"a", "b", "oracle"}
    steps = queue([], jobs, unready, [], {})
    assert [next(steps) for _ in range(3)] == [jobs[1], jobs[2], None]
    unready -= {"a"}
    assert next(steps) is None
    unready -= {"b"}
    assert list(steps) == [jobs[0]]


def test_a_job_that_starts_from_one_that_runs_alone_comes_after_it() -> None:
    jobs: Any = [FakeJob("oracle", starts=("a",)), FakeJob("a", alone=True), FakeJob("b")]
    assert list(queue([], jobs, {"a", "oracle"}, [], {})) == [jobs[2], jobs[1], jobs[0]]
