import pytest

from holobench_eval.study.executors.remaining import Kind, Remaining

SLOW, QUICK = ("slow", "here"), ("quick", "here")
ROWS = {SLOW: 20.0, QUICK: 2.0}


class Clock:
    """Told how late it is."""

    now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock():
    return Clock()


def compute(remaining: Remaining, clock: Clock, row: Kind, seconds: float, alone: bool = False) -> None:
    remaining.begins(row, row, alone)
    clock.now += seconds
    remaining.ends(row)


def test_the_longest_first_do_not_make_the_rest_look_long(clock):
    remaining = Remaining([(row, False) for row in ROWS for _ in range(5)], {}, 1, clock)
    for row, seconds in ROWS.items():  # each row once, since none is known; then the longest
        compute(remaining, clock, row, seconds)
    for left in (3, 2, 1, 0):
        compute(remaining, clock, SLOW, ROWS[SLOW])
        assert remaining.seconds() == pytest.approx(left * ROWS[SLOW] + 4 * ROWS[QUICK])


def test_time_is_unknown_at_first_passes_while_a_task_is_at_work_and_never_runs_out(clock):
    remaining = Remaining([(SLOW, False)] * 2, {}, 1, clock)
    assert remaining.seconds() is None
    remaining.begins("first", SLOW, False)
    clock.now += 20
    assert remaining.seconds() is None
    remaining.ends("first")
    remaining.begins("second", SLOW, False)
    for left in (5, 0):
        clock.now += 15
        assert remaining.seconds() == pytest.approx(left)
    remaining.ends("second")
    assert remaining.seconds() == 0


def test_to_what_was_measured_before_is_added_what_tasks_cost_beyond_it_after_the_first(clock):
    remaining = Remaining([(SLOW, False)] + [(QUICK, False)] * 3, ROWS, 1, clock)
    assert remaining.seconds() == pytest.approx(20 + 3 * 2)
    compute(remaining, clock, QUICK, 60)
    assert remaining.seconds() == pytest.approx(20 + 2 * 2)
    compute(remaining, clock, QUICK, 3)  # a second more: it is scored, too
    assert remaining.seconds() == pytest.approx(20 + 1 + 3)
    compute(remaining, clock, QUICK, 0.2)
    assert remaining.seconds() == pytest.approx(20)  # nothing is taken off


def test_only_the_first_tasks_of_the_run_are_left_out_not_those_of_every_row(clock):
    remaining = Remaining([(SLOW, False)] + [(QUICK, False)] * 3, {}, 1, clock)
    compute(remaining, clock, SLOW, 20)
    compute(remaining, clock, QUICK, 4)
    compute(remaining, clock, QUICK, 2)
    assert remaining.seconds() == pytest.approx(3)


def test_tasks_may_begin_and_end_while_the_time_left_is_looked_up(clock):
    turns = 0
    looking = False

    class Interrupted(str):
        """A row during whose look-up another thread has a turn, in which one task begins and ends and one begins."""

        def __hash__(self) -> int:
            nonlocal turns
            if looking:
                turns += 1
                for part in ("ended", "begun"):
                    remaining.begins(f"{turns} {part}", (f"{turns} {part}", "here"), False)
                remaining.ends(f"{turns} ended")
            return super().__hash__()

    rows: dict[str, Kind] = {row: (Interrupted(row), "here") for row in ("first", "done", "at work", "waiting")}
    remaining = Remaining([(row, False) for row in rows.values()], {}, 1, clock)
    compute(remaining, clock, rows["first"], 1)
    compute(remaining, clock, rows["done"], 1)
    remaining.begins("at work", rows["at work"], False)
    looking = True
    assert remaining.seconds() is not None
    assert turns > 3


def test_workers_share_what_is_left_but_for_a_long_task_and_those_that_run_alone(clock):
    remaining = Remaining([(SLOW, False)] * 4 + [(SLOW, True)], ROWS, 2, clock)
    assert remaining.seconds() == pytest.approx(2 * 20 + 20)
    for first in (0, 2):
        remaining.begins(first, SLOW, False)
        assert first == 0 or remaining.seconds() == pytest.approx(20 + 20)
        remaining.begins(first + 1, SLOW, False)
        clock.now += 20
        remaining.ends(first)
        remaining.ends(first + 1)
    compute(remaining, clock, SLOW, 20, alone=True)
    assert remaining.seconds() == 0


def test_the_first_task_of_a_worker_also_loads_libraries_and_does_not_count(clock):
    remaining = Remaining([(QUICK, False)] * 4, {}, 1, clock)
    compute(remaining, clock, QUICK, 30)
    assert remaining.seconds() == pytest.approx(3 * 30)  # nothing better is known
    compute(remaining, clock, QUICK, 2)
    assert remaining.seconds() == pytest.approx(2 * 2)


def test_a_method_costs_on_each_display_what_it_took_there(clock):
    kinds = [(("learned", name), False) for name in ("near", "far") for _ in range(3)]
    remaining = Remaining([*kinds, (("quick", "near"), False)], {("learned", "far"): 30.0}, 1, clock)
    compute(remaining, clock, ("quick", "near"), 1)
    assert remaining.seconds() == pytest.approx(6 * 30)  # what is known of the other display
    compute(remaining, clock, ("learned", "near"), 4)
    assert remaining.seconds() == pytest.approx(2 * 4 + 3 * 30)
    compute(remaining, clock, ("learned", "far"), 20)
    assert remaining.seconds() == pytest.approx(2 * 4 + 2 * 20)


def test_a_method_without_any_cost_makes_the_time_a_lower_limit_and_does_not_pass_for_another(clock):
    remaining = Remaining([(SLOW, False)] * 2 + [(QUICK, False)] * 3, {}, 1, clock)
    assert not remaining.is_whole()
    compute(remaining, clock, QUICK, 2)
    assert remaining.seconds() == pytest.approx(2 * 2)
    assert not remaining.is_whole()
    compute(remaining, clock, SLOW, 60)
    assert remaining.is_whole()
    assert remaining.seconds() == pytest.approx(2 * 2 + 60)


def test_one_outlier_does_not_lengthen_all_others(clock):
    names = [(name, "here") for name in "abc"]
    remaining = Remaining([(name, False) for name in names for _ in range(3)], dict.fromkeys(names, 2.0), 1, clock)
    compute(remaining, clock, names[0], 9)  # the first of the run
    for name, seconds in zip(names, (3, 3, 63), strict=True):
        compute(remaining, clock, name, seconds)
    assert remaining.seconds() == pytest.approx(1 * 3 + 2 * 3 + 2 * 63)
    compute(remaining, clock, names[2], 63)
    assert remaining.seconds() == pytest.approx(1 * 3 + 2 * 3 + 63)
