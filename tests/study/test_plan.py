from __future__ import annotations

from pathlib import Path

from holobench_eval.study.config import load_study
from holobench_eval.study.definition import Study
from holobench_eval.study.plan import FLOORS, REFERENCE, plan
from tests.study.studies import add_one_laser, add_other_profile
from tests.support.studies.fake_study import write_config


def study_in(folder: Path, methods: tuple[str, ...] = ("plugins.py:Toy",), **options: object) -> Study:
    return load_study(write_config(folder, methods, **options))  # type: ignore[arg-type]


def test_the_grid_is_methods_by_displays_by_targets_by_repeats(tmp_path):
    add_other_profile(tmp_path)
    config = write_config(tmp_path, ("plugins.py:Toy", "plugins.py:Seeing"), profiles="ideal, other.yaml")
    config.write_text(config.read_text() + "repeats: 4\n")
    cells = plan(load_study(config)).cells
    assert len(cells) == 3 * len(FLOORS) + 2 * 2 * 3 * 4
    assert len({cell.id for cell in cells}) == len(cells)


def test_a_method_on_some_displays_has_cells_on_those_only(tmp_path):
    add_other_profile(tmp_path)
    entry = '{name: "plugins.py:Toy", profiles: [other.yaml]}'
    grid = plan(study_in(tmp_path, (entry,), profiles="ideal, other.yaml", count=1))
    assert [cell.condition for cell in grid.cells] == [REFERENCE] * 5 + ["other"]


def test_a_blind_method_is_solved_once_for_displays_of_equal_optics_and_a_seeing_one_on_each(tmp_path):
    add_other_profile(tmp_path)

    def solved(method: str = "plugins.py:Toy") -> list[int]:
        tasks = plan(study_in(tmp_path, (method,), profiles="ideal, other.yaml", count=1)).tasks
        return [len(task.cells) for task in tasks if not task.is_floor]

    assert solved() == [2]
    assert solved("plugins.py:Seeing") == solved("oracle") == [1, 1]
    different = (tmp_path / "other.yaml").read_text().replace("distance: 0.1 ", "distance: 0.2 ")
    (tmp_path / "other.yaml").write_text(different)
    assert solved() == [1, 1]


def test_the_wrong_target_is_the_next_one_and_a_single_target_has_none(tmp_path):
    wrong = {c.target: c.params["target"] for c in plan(study_in(tmp_path)).cells if c.method == "floor_wrong_target"}
    assert wrong == {"gray 0": "gray 1", "gray 1": "gray 2", "gray 2": "gray 0"}
    assert set(FLOORS) - {cell.method for cell in plan(study_in(tmp_path, count=1)).cells} == {"floor_wrong_target"}


def test_a_display_with_targets_of_other_colours_has_floors_of_its_own(tmp_path):
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
