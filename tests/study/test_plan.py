from __future__ import annotations

from pathlib import Path

import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.study.config import load_study
from holobench_eval.study.definition import Study
from holobench_eval.study.plan import FLOORS, REFERENCE, plan
from tests.study.test_run import add_one_laser, add_other_profile
from tests.support.fake_study import write_config


def study_in(folder: Path, methods: tuple[str, ...] = ("plugins.py:Toy",), **options: object) -> Study:
    return load_study(write_config(folder, methods, **options))  # type: ignore[arg-type]


def test_the_grid_is_methods_by_displays_by_targets_by_repeats(tmp_path: Path) -> None:
    add_other_profile(tmp_path)
    config = write_config(tmp_path, ("plugins.py:Toy", "plugins.py:Seeing"), profiles="ideal, other.yaml")
    config.write_text(config.read_text() + "repeats: 4\n")
    cells = plan(load_study(config)).cells
    assert len(cells) == 3 * len(FLOORS) + 2 * 2 * 3 * 4
    assert len({cell.id for cell in cells}) == len(cells)


def test_planning_twice_gives_the_same_cells(tmp_path: Path) -> None:
    assert plan(study_in(tmp_path)) == plan(study_in(tmp_path))


def test_a_method_on_some_displays_has_cells_on_those_only(tmp_path: Path) -> None:
    add_other_profile(tmp_path)
    entry = '{name: "plugins.py:Toy", profiles: [other.yaml]}'
    grid = plan(study_in(tmp_path, (entry,), profiles="ideal, other.yaml", count=1))
    assert [cell.condition for cell in grid.cells] == [REFERENCE] * 5 + ["other"]


@pytest.mark.parametrize("method", ["plugins.py:Seeing", "oracle"])
def test_a_method_that_sees_the_display_is_solved_on_each(tmp_path: Path, method: str) -> None:
    add_other_profile(tmp_path)
    grid = plan(study_in(tmp_path, (method,), profiles="ideal, other.yaml", count=1))
    assert [len(task.cells) for task in grid.tasks if not task.is_floor] == [1, 1]


def test_a_blind_method_is_solved_once_for_displays_of_equal_nominal_optics(tmp_path: Path) -> None:
    add_other_profile(tmp_path)
    grid = plan(study_in(tmp_path, profiles="ideal, other.yaml", count=1))
    assert [len(task.cells) for task in grid.tasks if not task.is_floor] == [2]
    different = (tmp_path / "other.yaml").read_text().replace("distance: 0.1 ", "distance: 0.2 ")
    (tmp_path / "other.yaml").write_text(different)
    grid = plan(study_in(tmp_path, profiles="ideal, other.yaml", count=1))
    assert [len(task.cells) for task in grid.tasks if not task.is_floor] == [1, 1]


def test_a_single_target_has_no_wrong_target(tmp_path: Path) -> None:
    methods = {cell.method for cell in plan(study_in(tmp_path, count=1)).cells}
    assert set(FLOORS) - methods == {"floor_wrong_target"}


def test_the_wrong_target_is_the_next_one(tmp_path: Path) -> None:
    wrong = {c.target: c.params["target"] for c in plan(study_in(tmp_path)).cells if c.method == "floor_wrong_target"}
    assert wrong == {"gray 0": "gray 1", "gray 1": "gray 2", "gray 2": "gray 0"}


def test_training_images_are_never_targets(tmp_path: Path) -> None:
    config = write_config(tmp_path)
    config.write_text(config.read_text().replace("plugins.py:Gray", "plugins.py:Training"))
    with pytest.raises(UserError, match="training images"):
        load_study(config)


def test_a_row_may_have_an_exposure_of_its_own(tmp_path: Path) -> None:
    rows = ("plugins.py:Toy", '{name: "plugins.py:Toy", label: matched, exposure: matched}')
    alone, both = plan(study_in(tmp_path, rows[:1])), plan(study_in(tmp_path, rows))
    assert {cell.id for cell in alone.cells} < {cell.id for cell in both.cells}
    assert {cell.exposure for label, cell in both.labelled() if label == "matched"} == {"matched"}


def test_the_same_method_at_the_same_exposure_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="remove one"):
        study_in(tmp_path, ("plugins.py:Toy", '{name: "plugins.py:Toy", label: again, exposure: equal}'))


def test_a_second_baseline_is_the_label_of_a_row(tmp_path: Path) -> None:
    config = write_config(tmp_path)
    config.write_text(f"{config.read_text()}second_baseline: toy\n")
    with pytest.raises(UserError, match="no method has the label 'toy'"):
        load_study(config)


def test_a_display_with_targets_of_other_colours_has_floors_of_its_own(tmp_path: Path) -> None:
    add_one_laser(tmp_path)

    def floors(profiles: str) -> dict[str, set[str]]:
        found: dict[str, set[str]] = {}
        for task in plan(study_in(tmp_path, profiles=profiles)).tasks:
            for cell in task.cells if task.is_floor else ():
                found.setdefault(cell.condition, set()).add(cell.id)
        return found

    colour, gray = floors("ideal, other.yaml"), floors("one.yaml")
    assert set(colour) == set(gray) == {REFERENCE}
    assert floors("ideal, other.yaml, one.yaml") == colour | {"reference for one": gray[REFERENCE]}
