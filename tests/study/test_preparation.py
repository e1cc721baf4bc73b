from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.methods.calibrated.parametric import ParametricModel
from holobench_eval.study.artifacts import Artifacts
from holobench_eval.study.displays import Preparation
from tests.study.test_identity import BLIND, grid, write_profile
from tests.support import fake_trained

LEARNS = "parametric_model"
ROW, IMAGES = "{name: parametric_model, label: row}", "params: {count: 3}, held_out: 1"


def needs(folder: Path, *changes: tuple[str, str]) -> list[Preparation]:
    """What has to be learned for a study of a trained method, with pieces of its config exchanged."""
    return list(grid(folder, LEARNS, *changes).preparations().values())


def identity(folder: Path, *changes: tuple[str, str]) -> str:
    (needed,) = needs(folder, *changes)
    return needed.id


def test_what_the_learned_state_depends_on_makes_another_artifact(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    changes = [
        ("seed: 3", "seed: 4"),
        ("panel: [128, 128]", "panel: [128, 192]"),
        ("[mine.yaml]", "[leto-mild]"),
        ("held_out: 1", "held_out: 2"),
        ("held_out: 1", "held_out: 1, captures: 100"),
        ("dead_leaves", '"trained.py:Unseen"'),
        (IMAGES, "params: {count: 4}, held_out: 1"),
        (IMAGES, "params: {count: 3, seed: 1}, held_out: 1"),
        (ROW, "{name: parametric_model, params: {training: {rounds: 3}}}"),
        (ROW, "learned_kernel"),
    ]
    shutil.copy(fake_trained.__file__, tmp_path / "trained.py")
    found = [identity(tmp_path), *(identity(tmp_path, change) for change in changes)]
    for change in ("version: 1", "version: 2"), ("5.17e-7", "5.32e-7"), ("noise: false", "noise: true"):
        write_profile(tmp_path, "mine.yaml", change)
        found.append(identity(tmp_path))
    write_profile(tmp_path)
    monkeypatch.setattr(ParametricModel, "version", 99)
    found.append(identity(tmp_path))
    assert len(set(found)) == len(found)


@pytest.mark.parametrize(
    "change",
    [
        ('"Names"', '"Other words"'),
        ("[tv_lines, gray_ramp]", "[tv_lines]"),
        ("seed: 3", "seed: 3\nrepeats: 2"),
        ("seed: 3", "seed: 3\nheadline: ssim_linear"),
        ("seed: 3", "seed: 3\nmeasure: prediction"),
        ("seed: 3", "seed: 3\nsave: {captures: true}"),
        ("panel: [128, 128]", "panel: [128, 128], exposure: matched"),
        ("label: row", "label: other"),
        (ROW, f"{ROW}\n  - wirtinger"),
    ],
)
def test_nothing_else_does(tmp_path: Path, change: tuple[str, str]) -> None:
    assert identity(tmp_path, change) == identity(tmp_path)


def test_the_version_of_a_shipped_method_is_told(tmp_path: Path) -> None:
    (needed,) = needs(tmp_path)
    assert needed.description()["version"] == f"ParametricModel {ParametricModel.version}"


def test_every_display_is_learned_for_itself_and_once(tmp_path: Path) -> None:
    planned = grid(tmp_path, LEARNS, ("[mine.yaml]", "[ideal, leto-mild]"))
    assert sorted(needed.display.name for needed in planned.preparations().values()) == ["ideal", "leto-mild"]
    for task in planned.tasks:
        if not task.is_floor:
            assert task.preparation is not None
            assert [cell.prepared for cell in task.cells] == [(task.preparation.id,)]
            assert task.preparation.display.name == task.conditions[0].name


def test_a_method_that_learns_nothing_needs_nothing(tmp_path: Path) -> None:
    assert not grid(tmp_path, BLIND).preparations()


def test_a_description_is_plain_and_names_a_folder_inside_that_of_the_artifacts(tmp_path: Path) -> None:
    write_profile(tmp_path, "mine.yaml", ("name: ideal", 'name: "../../up"'))
    (needed,) = needs(tmp_path)
    assert json.loads(json.dumps(needed.description())) == needed.description()
    assert Artifacts(tmp_path / "artifacts").folder_of(needed).parent == tmp_path / "artifacts"


def test_images_that_nobody_trains_on_may_be_scored(tmp_path: Path) -> None:
    targets = "charts, params: {names: [tv_lines, gray_ramp]}"
    assert grid(tmp_path, BLIND, ("dead_leaves, params: {count: 3}", targets)).cells


def test_held_out_images_leave_some_to_train_on(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"study\.yaml:5:\d+: training\.held_out 3 leaves nothing of 3 images"):
        grid(tmp_path, LEARNS, ("held_out: 1", "held_out: 3"))
