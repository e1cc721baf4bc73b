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
targets: {dataset: light_fields, params: {places: [-0.4, 0.1, 0.4], given: [-0.5, -0.2, 0.2, 0.5], blur: 0.03}}
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
            assert {cell.change["eye_pupil"] for cell in task.cells} == {"-0.4", "0.1", "0.4"}
        cells = [cell for task in tasks[label] for cell in task.cells]
        assert len(cells) == 2 * 3 * 2
        assert {cell.condition for cell in cells} == {"ideal-frames", "plm-4bit"}


def test_a_phase_is_named_by_the_views_that_its_method_is_given(tmp_path: Path) -> None:
    tasks, dataset = solutions(tmp_path), load_study(tmp_path / "study.yaml").dataset
    views = sorted(dataset.views("shapes from 0.1"), key=lambda view: abs(dataset.place(view)))
    (one, every) = (tasks[label][0].cells[0].phase for label in ("wirtinger", "light_field"))
    assert one["target"]["sha256"] == dataset.digest(views[0])
    assert every["planes"] == [[dataset.digest(view), dataset.place(view)] for view in views]
    assert not one.get("planes")


def test_frames_that_know_the_views_are_better_off_centre_than_the_middle_view(tmp_path: Path) -> None:
    records = compute(write(tmp_path)).records
    assert {record["state"] for record in records} == {"done"}, [record["reason"] for record in records]
    scores = {(r["label"], r["cell"]["target"]): r["scores"].get("psnr_linear") for r in records}
    for target in ("shapes from -0.4", "shapes from 0.4"):
        assert scores["light_field", target] > scores["wirtinger", target] + 2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            (CONFIG[CONFIG.index("light_fields") : CONFIG.index("}\nmethods")], "charts"),
            "4:20: dataset 'charts' has no views; measure: views needs one that has, such as light_fields",
        ),
        (("profiles: [ideal-frames.yaml]", "profiles: [pluto-fourier]"), "2:10: measure: views needs a Fresnel plane"),
    ],
)
def test_what_has_no_views_is_refused_at_its_place(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    assert_refused(write(tmp_path, change), message)
