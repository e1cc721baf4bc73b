"""Light fields: what is planned, which method sees what, and what it is worth."""

from pathlib import Path

import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.study.config import load_study
from tests.study.studies import assert_refused, exchanged, tasks_of
from tests.support.studies.trained_study import compute

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
FRAMES = (Path(__file__).parents[3] / "configs/profiles/ideal-frames.yaml").read_text()
TWO_SCENES = ("{places:", "{scenes: [shapes, shapes-2], places:")
TWO_DISPLAYS = ("[ideal-frames.yaml]", "[ideal-frames.yaml, plm-4bit]")


def write(folder: Path, *changes: tuple[str, str]) -> Path:
    (folder / "ideal-frames.yaml").write_text(FRAMES)
    path = folder / "study.yaml"
    path.write_text(exchanged(CONFIG, *changes))
    return path


def test_every_method_makes_one_hologram_of_a_scene_that_all_places_see(tmp_path):
    tasks = tasks_of(write(tmp_path, TWO_SCENES, TWO_DISPLAYS))
    for label in ("wirtinger", "light_field"):
        for task in tasks[label]:
            assert len({cell.target.split(" ")[0] for cell in task.cells}) == 1
            assert {cell.change["eye_pupil"] for cell in task.cells} == {"-0.4", "0.1", "0.4"}
        displays = [cell.condition for task in tasks[label] for cell in task.cells]
        assert sorted(displays) == ["ideal-frames"] * 6 + ["plm-4bit"] * 6


def test_a_phase_is_named_by_the_views_that_its_method_is_given(tmp_path):
    tasks, dataset = tasks_of(write(tmp_path)), load_study(tmp_path / "study.yaml").dataset
    views = sorted(dataset.views("shapes from 0.1"), key=lambda view: abs(dataset.place(view)))
    (one, every) = (tasks[label][0].cells[0].phase for label in ("wirtinger", "light_field"))
    assert one["target"]["sha256"] == dataset.digest(views[0])
    assert every["planes"] == [[dataset.digest(view), dataset.place(view)] for view in views]
    assert not one.get("planes")


def test_frames_that_know_the_views_are_better_off_centre_than_the_middle_view(tmp_path):
    records = compute(write(tmp_path)).records
    assert {record["state"] for record in records} == {"done"}, [record["reason"] for record in records]
    scores = {(r["label"], r["cell"]["target"]): r["scores"].get("psnr_linear") for r in records}
    for target in ("shapes from -0.4", "shapes from 0.4"):
        assert scores["light_field", target] > scores["wirtinger", target] + 2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ((CONFIG[CONFIG.index("light_fields") : CONFIG.index("}\nmethods")], "charts"), "4:20: dataset 'charts' has"),
        (("[-0.4, 0.1, 0.4]", "[1.4]"), "4:51: dataset 'light_fields': parameter 'places.0'"),
        (("frames: 4", "frames: 9"), "7:12: frames: 9; 'ideal-frames' shows"),
        (("profiles: [ideal-frames.yaml]", "profiles: [pluto-fourier]"), "2:10: measure: views needs a Fresnel plane"),
    ],
)
def test_what_has_no_views_is_refused_at_its_place(tmp_path, change, message):
    assert_refused(write(tmp_path, change), message)


CODE = """
from holobench_eval.datasets.light_fields import LightFields

class Wide(LightFields):
    def place(self, view):
        return 3 * super().place(view)

def blind(target, bench):
    return target

blind.views = True
"""


def test_code_of_a_users_own_that_does_not_keep_its_word_is_refused(tmp_path):
    (tmp_path / "mine.py").write_text(CODE)
    path = write(tmp_path, ("{dataset: light_fields, params", "{dataset: 'mine.py:Wide', params"))
    with pytest.raises(UserError, match=r"from -1\.2.*; expected places from '-1' to '1' radii of the iris"):
        load_study(path)
    path = write(tmp_path, ("{name: wirtinger, params: {iterations: 30}}", "'mine.py:blind'"))
    with pytest.raises(UserError, match=r"blind': views is True, which needs a function solve_views"):
        load_study(path)
