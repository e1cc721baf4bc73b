from pathlib import Path
from unittest.mock import MagicMock, PropertyMock

import pytest

from holobench_eval import display
from holobench_eval.core.errors import CellError, UserError
from holobench_eval.study import opening
from holobench_eval.study.config import load_study
from holobench_eval.study.definition import Study
from holobench_eval.study.displays import condition
from holobench_eval.study.opening import open_display
from holobench_eval.study.plan import Task, plan
from tests.support.studies.fake_study import write_config

TEXT = Path(display.__file__).parent.joinpath("simulated", "profiles", "ideal.yaml").read_text()


def test_a_condition_tells_a_profile_at_the_panel_of_the_study(tmp_path):
    (tmp_path / "mine.yaml").write_text(TEXT.replace("name: ideal", "name: mine"))
    shown = condition("mine.yaml", (128, 256), tmp_path)
    assert (shown.name, shown.version, shown.spec.shape) == ("mine", 1, (128, 256))
    assert condition("mine.yaml", None, tmp_path).spec.shape == (1080, 1920)


def test_a_profile_that_changes_under_a_run_is_refused(tmp_path):
    (tmp_path / "mine.yaml").write_text(TEXT)
    shown = condition("mine.yaml", (128, 128), tmp_path)
    (tmp_path / "mine.yaml").write_text(f"{TEXT}# later\n")
    with pytest.raises(UserError, match="has changed since the study was planned"):
        open_display(shown, seed=0)


def test_a_failed_calibration_is_found_out_once(tmp_path, monkeypatch):
    (tmp_path / "mine.yaml").write_text(TEXT)
    shown, bench = condition("mine.yaml", (128, 128), tmp_path), MagicMock()
    type(bench.return_value).registration = PropertyMock(side_effect=CellError("no circles found"))
    monkeypatch.setattr(opening, "open_bench", bench)
    for _ in range(2):
        with pytest.raises(CellError, match="no circles found"):
            open_display(shown, seed=0)
    bench.assert_called_once()


SWEEPS = """sweeps:
  - {condition: drift, values: [0, 30]}
  - {condition: known_eye, values: ["-2"]}
"""


def study_with(folder: Path, sweeps: str, *methods: str) -> Study:
    config = write_config(folder, methods or ("plugins.py:Toy",), count=1)
    config.write_text(config.read_text() + sweeps)
    return load_study(config)


def solutions(study: Study) -> list[Task]:
    return [task for task in plan(study).tasks if not task.is_floor]


def test_a_blind_method_is_solved_once_for_changes_it_does_not_know_and_a_seeing_one_under_each(tmp_path):
    tasks = solutions(study_with(tmp_path, SWEEPS))
    conditions = [[cell.condition for cell in task.cells] for task in tasks]
    assert conditions == [["ideal", "ideal, drift 30 days"], ["ideal, known eye -2"]]
    assert tasks[1].conditions[0].spec.eye == pytest.approx((0.05, 0.05, 0))
    for method in ("plugins.py:Seeing", "oracle"):
        assert [len(task.cells) for task in solutions(study_with(tmp_path, SWEEPS, method))] == [1, 1, 1]


def test_a_trained_method_is_trained_once_before_any_change(tmp_path):
    grid = plan(study_with(tmp_path, SWEEPS, "parametric_model"))
    assert len(grid.preparations()) == 1
    assert {task.preparation.display.change for task in grid.tasks if task.preparation} == {None}


def test_the_nominal_value_is_the_unchanged_cell_and_any_other_value_another(tmp_path):
    plain, swept, other = (plan(study_with(tmp_path, text)) for text in ("", SWEEPS, SWEEPS.replace("30", "31")))
    assert {cell.id for cell in plain.cells} <= {cell.id for cell in swept.cells}
    assert len({cell.id for cell in swept.cells} ^ {cell.id for cell in other.cells}) == 2
    changed = [cell for cell in swept.cells if cell.change]
    assert [dict(cell.change) for cell in changed] == [{"drift": 30.0}, {"known_eye": "-2"}]
    assert all(cell.description()["display"]["change"] for cell in changed)
    assert not any("change" in cell.description().get("display", {}) for cell in plain.cells)


def test_a_count_of_siblings_is_a_list_of_names(tmp_path):
    study = study_with(tmp_path, "sweeps: [{condition: sibling, count: 3}]\n")
    assert study.sweeps[0].values == ("1", "2", "3")


@pytest.mark.parametrize(
    ("sweep", "message"),
    [
        ("{condition: drfit, values: [1]}", "unknown condition 'drfit'; did you mean 'drift'?"),
        ("{condition: drift, values: [-1]}", "drift is a number [days] from 0 to 3650, got -1"),
        ("{condition: drift, values: [1, 2, 1.0]}", "drift 1.0 is listed twice"),
        ("{condition: drift}", "a sweep has values"),
        ("{condition: sensor, values: [nikon]}", "unknown camera 'nikon'"),
        ("{condition: eye, values: [blind]}", "prescription 'blind'"),
        ("{condition: drift, values: [1], profiles: [leto]}", "'leto' is not in display.profiles"),
    ],
)
def test_a_sweep_that_means_nothing_is_one_line_with_its_place(tmp_path, sweep, message):
    with pytest.raises(UserError, match=r"study.yaml:\d+:\d+: ") as refused:
        study_with(tmp_path, f"sweeps:\n  - {sweep}\n")
    assert message in str(refused.value)


def test_a_display_is_opened_once_for_every_change(tmp_path):
    place = condition("ideal", (128, 128), tmp_path)
    grid = plan(study_with(tmp_path, SWEEPS))
    shown = {place.title: place for task in grid.tasks for place in task.conditions}
    benches = {title: open_display(place, 5) for title, place in shown.items()}
    assert open_display(shown["ideal"], 5) is benches["ideal"]
    assert benches["ideal, drift 30 days"].bench.profile.drift.days == 30
    assert benches["ideal, known eye -2"].registration is benches["ideal"].registration
    assert benches["ideal, drift 30 days"].registration is not benches["ideal"].registration
    assert place.change is None
