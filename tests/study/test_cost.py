import subprocess
import sys
import weakref
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from holobench_eval.study import cost
from holobench_eval.study.config import load_study
from holobench_eval.study.plan import plan
from tests.study.studies import add_other_profile, planned
from tests.support.studies.fake_study import write_config

ROOT = Path(__file__).parents[2]
LARGE = 48


def touched(mib: int) -> float:
    """Fill so many MiB and let go of them."""
    return float(np.ones(mib * 2**17).sum())


def peak_of_what_is_let_go() -> cost.Cost:
    watch = cost.Stopwatch()
    touched(LARGE)
    return watch.stop()


def peak_beside_what_is_held() -> cost.Cost:
    held = np.ones(LARGE * 2**17)
    touched(LARGE)
    watch = cost.Stopwatch()
    touched(4)
    taken = watch.stop()
    assert held.any()
    return taken


def peak_of_what_is_taken_again() -> cost.Cost:
    pieces = [np.ones(2**13) for _ in range(LARGE * 16)]  # small, so that the allocator keeps them
    del pieces
    watch = cost.Stopwatch()
    pieces = [np.ones(2**13) for _ in range(LARGE * 16)]
    taken = watch.stop()
    assert len(pieces) == LARGE * 16
    return taken


PEAKS = (peak_of_what_is_let_go, peak_beside_what_is_held, peak_of_what_is_taken_again)


@pytest.mark.skipif(not Path("/proc/self/clear_refs").exists(), reason="memory is measured on Linux alone")
def test_the_peak_counts_without_earlier_ones_or_held_memory_and_with_what_is_taken_again():
    """In a process of its own: in one where the program break could once not be raised, as other tests may leave it,
    glibc no longer gives back what lies at the end of its memory."""
    code = f"from {__name__} import PEAKS; print(*(of().memory_mib for of in PEAKS))"
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, text=True, capture_output=True, check=True)
    let_go, beside_held, again = map(float, run.stdout.split())
    assert LARGE - 2 < let_go < LARGE + 16
    assert beside_held < LARGE / 2
    assert again > LARGE / 2


def test_without_the_linux_files_time_alone_is_measured(tmp_path, monkeypatch):
    monkeypatch.setattr(cost, "PROCESS", tmp_path / "nowhere")
    taken = cost.Stopwatch().stop()
    assert taken.memory_mib is None
    assert taken.seconds >= 0


def test_what_a_solution_left_in_circles_is_let_go_before_the_next():
    cost.Stopwatch().stop()
    left = type("Node", (), {})()
    left.own = left
    seen = weakref.ref(left)
    del left
    cost.Stopwatch().stop()
    assert seen() is None


@pytest.fixture(autouse=True)
def every_time(monkeypatch):
    monkeypatch.setattr(cost, "APART", 0.0)


def test_estimates_use_the_last_measurement_and_many_write_few_files(monkeypatch):
    for seconds in (2.5, 9.0):
        cost.keep("a", seconds)
        assert cost.recorded("a") == seconds
    monkeypatch.setattr(cost, "APART", 1000.0)
    cost.keep("a", 4.0)
    assert cost.recorded("a") == 9.0


@pytest.mark.parametrize("content", ["", "[]", "{}", "x", "-1", "NaN", "inf", "\xff"])
def test_a_damaged_file_counts_as_no_measurement(content):
    cost.keep("a", 2.5)
    (cost.folder() / "a").write_text(content, encoding="latin-1")
    assert cost.recorded("a") is None
    cost.keep("a", 3.0)
    assert cost.recorded("a") == 3.0


def test_without_a_folder_to_write_to_there_are_no_estimates(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    cost.keep("a", 2.5)
    assert cost.recorded("a") is None


def test_every_row_of_the_tables_is_timed_by_its_last_solution_of_the_first_repeat(tmp_path):
    add_other_profile(tmp_path)
    config = write_config(tmp_path, ("plugins.py:Toy", "plugins.py:Seeing"), profiles="ideal, other.yaml")
    config.write_text(f"{config.read_text()}repeats: 2\ntiming: alone\n")
    study = load_study(config)
    grid = plan(study)
    timed = [cell for cell in grid.cells if cell.id in cost.timed(study, grid)]
    rows = [(method, display) for method in ("Toy", "Seeing") for display in ("ideal", "other")]
    assert [(cell.method.rpartition(":")[2], cell.condition) for cell in timed] == rows
    assert {(cell.target, cell.repeat) for cell in timed} == {("gray 2", 0)}
    assert not cost.timed(replace(study, timing="shared"), grid)


def test_targets_share_a_time_and_threads_workers_and_methods_do_not(tmp_path):
    first, second = planned(write_config(tmp_path)).tasks[-2:]
    assert first.cells[0].target != second.cells[0].target
    assert cost.key(first, 1, 1) == cost.key(second, 1, 1) == cost.key(replace(first, label="renamed"), 1, 1)
    other = replace(first, cells=(replace(first.cells[0], phase={**first.cells[0].phase, "code": "changed"}),))
    keys = {cost.key(first, 1, 1), cost.key(first, 2, 1), cost.key(first, 1, 2), cost.key(other, 1, 1)}
    assert len(keys) == 4
