from __future__ import annotations

import pytest

from holobench_eval.study.remaining import Remaining

ROWS = {"slow": 20.0, "quick": 2.0}


class Clock:
    """Told how late it is."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def compute(remaining: Remaining, clock: Clock, row: str, seconds: float, alone: bool = False) -> None:
    remaining.begins(row, row, alone)
    clock.now += seconds
    remaining.ends(row)


def test_nothing_is_said_before_anything_is_known() -> None:
    clock = Clock()
    remaining = Remaining([("slow", False)] * 2, {}, 1, clock)
    assert remaining.seconds() is None
    remaining.begins("first", "slow", False)
    clock.now += 5
    assert remaining.seconds() is None


def test_the_longest_first_do_not_make_the_rest_look_long() -> None:
    clock = Clock()
    remaining = Remaining([(row, False) for row in ROWS for _ in range(5)], {}, 1, clock)
    for row, seconds in ROWS.items():  # each row once, since none is known; then the longest
        compute(remaining, clock, row, seconds)
    for left in (3, 2, 1, 0):
        compute(remaining, clock, "slow", ROWS["slow"])
        assert remaining.seconds() == pytest.approx(left * ROWS["slow"] + 4 * ROWS["quick"])


def test_time_passes_while_a_task_is_at_work_and_never_runs_out() -> None:
    clock = Clock()
    remaining = Remaining([("slow", False)] * 2, {}, 1, clock)
    compute(remaining, clock, "slow", 20)
    remaining.begins("second", "slow", False)
    clock.now += 15
    assert remaining.seconds() == pytest.approx(5)
    clock.now += 15
    assert remaining.seconds() == 0
    remaining.ends("second")
    assert remaining.seconds() == 0


def test_what_was_measured_before_is_weighted_by_what_rows_cost_now() -> None:
    clock = Clock()
    remaining = Remaining([("slow", False), ("quick", False), ("quick", False)], ROWS, 1, clock)
    assert remaining.seconds() == pytest.approx(20 + 2 + 2)
    compute(remaining, clock, "quick", 3)  # half as much again: it is scored, too
    assert remaining.seconds() == pytest.approx(1.5 * 20 + 3)


def test_workers_share_what_is_left_but_for_a_long_task_and_those_that_run_alone() -> None:
    clock = Clock()
    remaining = Remaining([("slow", False)] * 4 + [("slow", True)], ROWS, 2, clock)
    assert remaining.seconds() == pytest.approx(2 * 20 + 20)
    remaining.begins(0, "slow", False)
    remaining.begins(1, "slow", False)
    clock.now += 20
    remaining.ends(0)
    remaining.ends(1)
    remaining.begins(2, "slow", False)
    assert remaining.seconds() == pytest.approx(20 + 20)
    remaining.begins(3, "slow", False)
    clock.now += 20
    remaining.ends(2)
    remaining.ends(3)
    compute(remaining, clock, "slow", 20, alone=True)
    assert remaining.seconds() == 0


def test_the_first_task_of_a_worker_also_loads_libraries_and_does_not_count() -> None:
    clock = Clock()
    remaining = Remaining([("quick", False)] * 4, {}, 1, clock)
    compute(remaining, clock, "quick", 30)
    assert remaining.seconds() == pytest.approx(3 * 30)  # nothing better is known
    compute(remaining, clock, "quick", 2)
    assert remaining.seconds() == pytest.approx(2 * 2)
