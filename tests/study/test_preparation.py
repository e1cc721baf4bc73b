from __future__ import annotations

import json
from pathlib import Path

import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.methods.calibrated.parametric import ParametricModel
from holobench_eval.study.artifacts import Artifacts
from holobench_eval.study.config import load_study
from holobench_eval.study.plan import plan
from tests.support.trained_study import needs, write, write_profile

METHODS = 'methods: ["trained.py:Gain"]'
TRAINING = 'training: {dataset: "trained.py:Unseen", held_out: 1}'


def identity(folder: Path, *changes: tuple[str, str]) -> str:
    (needed,) = needs(write(folder, *changes))
    return needed.id


@pytest.mark.parametrize(
    "change",
    [
        ("seed: 3", "seed: 4"),
        ("panel: [128, 128]", "panel: [128, 192]"),
        ("[ideal]", "[leto-mild]"),
        ("held_out: 1", "held_out: 2"),
        ("held_out: 1", "held_out: 1, captures: 100"),
        ('"trained.py:Unseen"', "dead_leaves"),
        ("held_out: 1", "held_out: 1, params: {count: 4}"),
        ("held_out: 1", "held_out: 1, params: {seed: 1}"),
        (METHODS, 'methods: [{name: "trained.py:Gain", params: {rounds: 3}}]'),
        (METHODS, 'methods: ["trained.py:Blind"]'),
    ],
)
def test_what_the_learned_state_depends_on_makes_another_artifact(tmp_path: Path, change: tuple[str, str]) -> None:
    assert identity(tmp_path, change) != identity(tmp_path)


@pytest.mark.parametrize(
    "change",
    [
        ('"Trained"', '"Other words"'),
        ("count: 1", "count: 2"),
        ("seed: 3", "seed: 3\nrepeats: 2"),
        ("seed: 3", "seed: 3\nheadline: ssim_linear"),
        ("seed: 3", "seed: 3\nmeasure: prediction"),
        ("seed: 3", "seed: 3\nsave: {captures: true}"),
        ("panel: [128, 128]", "panel: [128, 128], exposure: matched"),
        (METHODS, 'methods: [{name: "trained.py:Gain", label: other}]'),
        (METHODS, 'methods: [wirtinger, "trained.py:Gain", "trained.py:Even"]'),
    ],
)
def test_nothing_else_does(tmp_path: Path, change: tuple[str, str]) -> None:
    assert identity(tmp_path, change) == identity(tmp_path)


def test_a_new_version_of_a_shipped_method_makes_another_artifact(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = write(tmp_path, (METHODS, "methods: [parametric_model]"))
    (before,) = needs(config)
    assert before.description()["version"] == f"ParametricModel {ParametricModel.version}"
    monkeypatch.setattr(ParametricModel, "version", 99)
    assert needs(config)[0].id != before.id


@pytest.mark.parametrize(
    "change", [("version: 1", "version: 2"), ("5.17e-7", "5.32e-7"), ("noise: false", "noise: true")]
)
def test_a_changed_profile_makes_another_artifact(tmp_path: Path, change: tuple[str, str]) -> None:
    before = identity(tmp_path, write_profile(tmp_path))
    assert identity(tmp_path, write_profile(tmp_path, change)) != before


def test_every_display_is_learned_for_itself_and_once(tmp_path: Path) -> None:
    both = write_profile(tmp_path)[0], "[ideal, mine.yaml]"
    config = write(tmp_path, both, ("count: 1", "count: 2"))
    grid = plan(load_study(config))
    assert sorted(needed.display.name for needed in grid.preparations().values()) == ["ideal", "mine"]
    for task in grid.tasks:
        if not task.is_floor:
            assert task.preparation is not None
            assert [cell.prepared for cell in task.cells] == [(task.preparation.id,)]
            assert task.preparation.display.name == task.conditions[0].name


def test_a_method_that_learns_nothing_needs_nothing(tmp_path: Path) -> None:
    assert needs(write(tmp_path, (METHODS, 'methods: [wirtinger, "trained.py:Even"]'))) == []


def test_a_description_is_plain_and_names_a_folder_inside_that_of_the_artifacts(tmp_path: Path) -> None:
    write_profile(tmp_path)
    profile = tmp_path / "mine.yaml"
    profile.write_text(profile.read_text().replace("name: mine", 'name: "../../up"'))
    (needed,) = needs(write(tmp_path, ("[ideal]", "[mine.yaml]")))
    assert json.loads(json.dumps(needed.description())) == needed.description()
    assert Artifacts(tmp_path / "artifacts").folder_of(needed).parent == tmp_path / "artifacts"


def test_images_that_nobody_trains_on_may_be_scored(tmp_path: Path) -> None:
    training = (TRAINING, 'training: {dataset: "trained.py:Pictures", held_out: 1}')
    assert plan(load_study(write(tmp_path, training, (METHODS, "methods: [wirtinger]")))).cells


def test_held_out_images_leave_some_to_train_on(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"study\.yaml:5:\d+: training\.held_out 3 leaves nothing of 3 images"):
        load_study(write(tmp_path, ("held_out: 1", "held_out: 3")))
