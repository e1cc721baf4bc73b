import io
import math

import pytest
from rich.console import Console

from holobench_eval.commands.plan import Row, TrainingRow, preview, table
from holobench_eval.study import plan as planning
from holobench_eval.study.config import load_study
from holobench_eval.study.definition import Study
from holobench_eval.study.executors import Serial
from holobench_eval.study.running.progress import Lines, duration, watching
from holobench_eval.study.running.run import run
from holobench_eval.study.store import Record, Store
from tests.study.studies import compute
from tests.support.studies.fake_study import write_config

pytestmark = pytest.mark.usefixtures("no_physics")


def failed(task: planning.Task) -> list[Record]:
    return [
        Record(cell.description(), "failed", task.label, cell.condition, cell.target, "no [light]")
        for cell in task.cells
    ]


@pytest.fixture
def task(tmp_path):
    """The last of a study."""
    return planning.plan(load_study(write_config(tmp_path))).tasks[-1]


def test_plain_lines_come_at_most_every_few_seconds(task):
    now = [0.0]
    lines: list[str] = []
    watch = Lines(lines.append, clock=lambda: now[0])
    watch.planned(100, 60, 42)
    for _ in range(60):
        watch.started(task)
        now[0] += 1.0
        watch.finished([])
    assert lines[0] == "60 of 100 cells to compute (42 of the 100 are floor images, which no method made)"
    assert len(lines) == 1 + 60 // 5 - 1


@pytest.mark.parametrize("terminal", [True, False])
def test_a_failure_is_told_at_once_and_counted_whatever_the_console_is(task, terminal):
    text = io.StringIO()
    with watching(Console(file=text, force_terminal=terminal, width=120)) as watch:
        watch.planned(2, 1, 0)
        watch.started(task)
        watch.finished(failed(task))
        assert "failed: Toy · ideal · gray 2: no [light]" in text.getvalue()
        assert watch.failures == 1
    assert ("1 failed" in text.getvalue()) == terminal


def test_a_preview_counts_what_is_done_and_what_it_would_take(tmp_path):
    config = write_config(tmp_path, ('{name: "plugins.py:Toy", params: {fail: "no"}}', "plugins.py:Seeing"))
    study = load_study(config)
    grid, store = planning.plan(study), Store(tmp_path / "out")
    before = preview(study, grid, store, threads=1, workers=1)
    rows = [(row.label, row.cells, row.missing, row.seconds) for row in before]
    assert rows == [("floor", 18, 18, None), ("Toy", 3, 3, None), ("Seeing", 3, 3, None)]
    compute(config, tmp_path / "out")
    after = preview(study, grid, store, threads=1, workers=1)
    assert [(row.done, row.failed, row.missing) for row in after] == [(18, 0, 0), (2, 1, 0), (3, 0, 0)]
    elsewhere = preview(study, grid, Store(tmp_path / "new"), threads=1, workers=1)
    assert all(row.seconds is not None and row.seconds > 0 for row in elsewhere[1:])


def test_a_preview_counts_photographs_as_the_board_does(tmp_path):
    watching = "{name: online_camera, captures: 9, params: {captures: 12}}"
    study = load_study(write_config(tmp_path, ("wirtinger", watching, "hil", "hil_plus")))
    states = (("hil", "done", 62), ("hil_plus", "unfinished", 5))
    learning = [TrainingRow(f"{name}-a", (name,), state, taken, 1.0) for name, state, taken in states]
    rows = preview(study, planning.plan(study), Store(tmp_path), threads=1, workers=1, learning=learning)
    targets = len(study.items)
    assert [row.photographs for row in rows[:4]] == [None, 0, 9 * targets, 62]
    assert math.isnan(rows[4].photographs or 0)
    assert "?" in printed(study, rows)


def printed(study: Study, rows: list[Row], width: int = 160) -> str:
    """The table of a preview."""
    text = io.StringIO()
    Console(file=text, width=width).print(table(study, rows))
    return text.getvalue()


UNTIMED = Row("c", 1, 2, 4, 50, 0, 0, 4, None)


def test_the_table_of_a_preview_shows_sums_and_brackets_floors_and_times_where_any_is_known(tmp_path):
    study = load_study(write_config(tmp_path))
    text = printed(study, [Row("a[b]", 1, 2, 30, None, 10, 0, 20, 1.5), UNTIMED])
    assert all(word in text for word in ("a[b]", "34", "24", "at least 1.5", "50", "not timed", "solving"))
    assert not any(word in printed(study, [UNTIMED]) for word in ("solving", "not timed"))
    text = printed(study, preview(study, planning.plan(study), Store(tmp_path / "out"), threads=1, workers=1))
    assert all(words in text for words in ("floor images, no method", "all, 18 of them floors"))


def test_the_table_of_a_preview_fits_80_columns_without_cutting_a_number(tmp_path):
    rows = [
        Row("online_camera_network", 3, 28, 1234, 2800, 1000, 12, 1222, 12345.0),
        Row("x" * 60, 3, 28, 84, None, 0, 0, 84, None),
    ]
    lines = printed(load_study(write_config(tmp_path)), rows, width=80).splitlines()
    assert max(map(len, lines)) <= 80
    assert "…" not in "".join(lines)
    assert all(any(word in line.split() for line in lines) for word in ("displays", "photos", "1222", "2800", "1318"))


def bar(task: planning.Task, is_whole: bool) -> str:
    """What a terminal shows of a run with 90 s left."""
    text = io.StringIO()
    with watching(Console(file=text, force_terminal=True, width=120)) as watch:
        watch.planned(2, 2, 0)
        watch.expects(lambda: 90.0, lambda: is_whole)
        watch.started(task)
    return text.getvalue()


def test_lines_and_bar_show_the_time_left_of_the_run_or_its_lower_limit(task):
    now, lines = [0.0], list[str]()
    watch = Lines(lines.append, clock=lambda: now[0])
    watch.planned(2, 2, 0)
    for seconds, is_whole, said in (
        *((None, True, ""), (90.0, True, ", about 90 s left; now"), (90.0, False, ", at least 90 s left; now")),
        (0.2, False, ""),  # a lower limit of nothing is not said
    ):
        watch.expects(lambda: seconds, lambda: is_whole)  # noqa: B023
        now[0] += 10
        watch.started(task)
        assert said in lines[-1]
        assert ("left" in lines[-1]) == bool(said)
    whole, lowest = bar(task, True), bar(task, False)
    assert "about 90 s" in whole
    assert "at least" not in whole
    assert "at least 90 s" in lowest


@pytest.mark.parametrize(
    ("seconds", "words"), [(0.25, "0.25 s"), (9.4, "9.4 s"), (99.4, "99 s"), (1351, "23 min"), (12_600, "3.5 h")]
)
def test_a_time_is_said_in_the_unit_that_people_would_use(seconds, words):
    assert duration(seconds) == words


def test_a_run_says_what_is_left_and_a_single_worker_tries_every_method_before_it_repeats_one(tmp_path):
    study = load_study(write_config(tmp_path, ("plugins.py:Toy", "plugins.py:Seeing")))
    left, started = list[float | None](), list[str]()

    class Asking(Lines):
        def started(self, task: planning.Task) -> None:
            super().started(task)
            started.append(task.label)

        def finished(self, records: list[Record]) -> None:
            super().finished(records)
            left.append(self.seconds_left())

    run(study, planning.plan(study), tmp_path / "out", Serial(), Asking(lambda line: None), 1, tmp_path / "artifacts")
    assert all(seconds is not None and seconds >= 0 for seconds in left)
    assert left[-1] == 0
    assert started == ["floor", "Toy", "Seeing", "floor", "floor", "Toy", "Toy", "Seeing", "Seeing"]
