"""Light fields: what is planned, which method sees what, and what it is worth."""

from __future__ import annotations

from pathlib import Path

import pytest

from holobench_eval.study.config import load_study
from holobench_eval.study.plan import Task, plan
from tests.study.studies import assert_refused, exchanged
from tests.support.trained_study import compute

CONFIG = """\
title: "Views"
measure: views
display: {profiles: [ideal-frames.yaml], panel: [128, 128]}
targets: {dataset: light_fields, params: {places: [-0.5, 0, 0.5], blur: 0.03}}
methods:
  - {name: wirtinger, params: {iterations: 30}}
  - {name: light_field, params: {frames: 4, iterations: 60}}
protocol: {metrics: [psnr]}
"""
FRAMES = (Path(__file__).parents[2] / "configs/profiles/ideal-frames.yaml").read_text()
TWO_SCENES = ("{places:", "{scenes: [shapes, shapes-2], places:")
TWO_DISPLAYS = ("[ideal-frames.yaml]", "[ideal-frames.yaml, plm-4bit]")


def write(folder: Path, *changes: tuple[str, str]) -> Path:
    (folder / "ideal-frames.yaml").write_text(FRAMES)
    path = folder / "study.yaml"
    path.write_text(exchanged(CONFIG, *changes))
    return path


def solutions(folder: Path, *changes: tuple[str, str]) -> dict[str, list[Task]]:
    """The tasks of every method."""
    tasks: dict[str, list[Task]] = {}
    for task in plan(load_study(write(folder, *changes))).tasks:
        tasks.setdefault(task.label, []).append(task)
    return tasks


def test_every_method_makes_one_hologram_of_a_scene_that_all_places_see(tmp_path: Path) -> None:
    tasks = solutions(tmp_path, TWO_SCENES, TWO_DISPLAYS)
    for label in ("wirtinger", "light_field"):
        for task in tasks[label]:
            assert {cell.target.split(" ")[0] for cell in task.cells} == {task.cells[0].target.split(" ")[0]}
            assert task.cells[0].target.endswith(" from 0")
            assert {cell.change["eye_pupil"] for cell in task.cells} == {"-0.5", "0", "0.5"}
        cells = [cell for task in tasks[label] for cell in task.cells]
        assert len(cells) == 2 * 3 * 2
        assert {cell.condition for cell in cells} == {"ideal-frames", "plm-4bit"}


def test_a_hologram_of_the_middle_view_is_that_of_its_picture_and_one_of_all_views_is_another(tmp_path: Path) -> None:
    views, pictures = solutions(tmp_path), solutions(tmp_path, ("measure: views\n", ""))
    named = {cell.target: cell.phase_id for task in pictures["wirtinger"] for cell in task.cells}
    assert {cell.phase_id for cell in views["wirtinger"][0].cells} == {named["shapes from 0"]}
    fewer = solutions(tmp_path, ("[-0.5, 0, 0.5]", "[0, 0.5]"))
    names = {tasks["light_field"][0].cells[0].phase_id for tasks in (views, fewer)}
    assert len(names) == 2


def test_frames_that_know_the_views_are_better_off_centre_than_the_middle_view(tmp_path: Path) -> None:
    records = compute(write(tmp_path)).records
    assert {record["state"] for record in records} == {"done"}, [record["reason"] for record in records]
    scores = {(r["label"], r["cell"]["target"]): r["scores"].get("psnr_linear") for r in records}
    for target in ("shapes from -0.5", "shapes from 0.5"):
        assert scores["light_field", target] > scores["wirtinger", target] + 2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            ("light_fields, params: {places: [-0.5, 0, 0.5], blur: 0.03}", "charts"),
            "4:20: dataset 'charts' has no views; measure: views needs one that has, such as light_fields",
        ),
        (("profiles: [ideal-frames.yaml]", "profiles: [pluto-fourier]"), "2:10: measure: views needs a Fresnel plane"),
    ],
)
def test_what_has_no_views_is_refused_at_its_place(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    assert_refused(write(tmp_path, change), message)
