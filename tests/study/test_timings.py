from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from holobench_eval.study import cost
from holobench_eval.study.config import load_study
from holobench_eval.study.plan import plan
from tests.study.studies import add_other_profile
from tests.support.fake_study import write_config


@pytest.fixture(autouse=True)
def every_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cost, "APART", 0.0)


def test_the_last_measurement_is_the_one_that_estimates_use_and_many_write_few_files(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for seconds in (2.5, 9.0):
        cost.keep("a", seconds)
        assert cost.recorded("a") == seconds
    monkeypatch.setattr(cost, "APART", 1000.0)
    cost.keep("a", 4.0)
    assert cost.recorded("a") == 9.0


@pytest.mark.parametrize("content", ["", "[]", "{}", "x", "-1", "NaN", "inf", "\xff"])
def test_a_damaged_file_counts_as_no_measurement(content: str) -> None:
    cost.keep("a", 2.5)
    (cost.folder() / "a").write_text(content, encoding="latin-1")
    assert cost.recorded("a") is None
    cost.keep("a", 3.0)
    assert cost.recorded("a") == 3.0


def test_without_a_folder_to_write_to_there_are_no_estimates(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    cost.keep("a", 2.5)
    assert cost.recorded("a") is None


def test_every_row_of_the_tables_is_timed_by_its_last_solution_of_the_first_repeat(tmp_path: Path) -> None:
    add_other_profile(tmp_path)
    config = write_config(tmp_path, ("plugins.py:Toy", "plugins.py:Seeing"), profiles="ideal, other.yaml")
    config.write_text(f"{config.read_text()}repeats: 2\ntiming: alone\n")
    study = load_study(config)
    grid = plan(study)
    timed = [cell for cell in grid.cells if cell.id in cost.timed(study, grid)]
    assert [(cell.method.rpartition(":")[2], cell.condition) for cell in timed] == [
        ("Toy", "ideal"),
        ("Toy", "other"),
        ("Seeing", "ideal"),
        ("Seeing", "other"),
    ]
    assert {(cell.target, cell.repeat) for cell in timed} == {("gray 2", 0)}
    assert not cost.timed(replace(study, timing="shared"), grid)


def test_targets_share_a_time_and_threads_workers_and_methods_do_not(tmp_path: Path) -> None:
    first, second = plan(load_study(write_config(tmp_path))).tasks[-2:]
    assert first.cells[0].target != second.cells[0].target
    assert cost.key(first, 1, 1) == cost.key(second, 1, 1) == cost.key(replace(first, label="renamed"), 1, 1)
    other = replace(first, cells=(replace(first.cells[0], phase={**first.cells[0].phase, "code": "changed"}),))
    keys = {cost.key(first, 1, 1), cost.key(first, 2, 1), cost.key(first, 1, 2), cost.key(other, 1, 1)}
    assert len(keys) == 4
