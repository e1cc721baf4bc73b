"""Focal stacks: what is planned, what is shown where, and what is scored."""

from pathlib import Path

import pytest
import torch

from holobench_eval.core.errors import CellError
from holobench_eval.metrics import score
from holobench_eval.study.plan import REFERENCE
from holobench_eval.study.scoring.scores import in_focus
from tests.study.studies import assert_refused, exchanged, planned, tasks_of
from tests.support import plugins
from tests.support.studies.trained_study import compute, computed

CONFIG = """\
title: "Depth"
measure: focus
display: {profiles: [ideal], panel: [128, 128]}
targets: {dataset: focal_stacks, params: {planes: [-1.5, 0, 1.5], blur: 0.03}}
methods:
  - {name: wirtinger, params: {iterations: 20}}
  - {name: multi_plane, params: {iterations: 20}}
  - {name: "middle.py:Middle", params: {iterations: 20}}
headline: psnr_linear_infocus
protocol: {metrics: [psnr, ssim]}
"""

MIDDLE = plugins.text("middle")


def write(folder: Path, *changes: tuple[str, str]) -> Path:
    (folder / "middle.py").write_text(MIDDLE)
    path = folder / "study.yaml"
    path.write_text(exchanged(CONFIG, *changes))
    return path


TWO_SCENES = ("{planes:", "{scenes: [shapes, shapes-2], planes:")
TWO_DISPLAYS = ("[ideal]", "[leto-mild, leto-aged]")


def test_most_methods_solve_every_picture_and_one_of_planes_every_scene(tmp_path):
    tasks = tasks_of(write(tmp_path, TWO_SCENES, TWO_DISPLAYS))
    assert [len(task.cells) for task in tasks["wirtinger"]] == [2] * 6
    assert [len(task.cells) for task in tasks["multi_plane"]] == [6] * 2


def test_cells_carry_the_display_and_where_the_camera_is(tmp_path):
    tasks = tasks_of(write(tmp_path))
    lens = {task.cells[0].target: dict(task.cells[0].change) for task in tasks["wirtinger"]}
    assert lens == {"shapes@-1.5mm": {"refocus": -1.5}, "shapes@0mm": {}, "shapes@1.5mm": {"refocus": 1.5}}
    (stack,) = tasks["multi_plane"]
    assert [dict(cell.change) for cell in stack.cells] == [{"other_plane": -1.5}, {}, {"other_plane": 1.5}]
    assert {cell.condition for cell in stack.cells} == {"ideal"}
    assert "infocus" in planned(tmp_path / "study.yaml").metrics


def test_the_wrong_target_is_another_scene(tmp_path):
    wrong = {
        cell.target: cell.params["target"]
        for task in tasks_of(write(tmp_path, TWO_SCENES))["floor"]
        for cell in task.cells
        if cell.method == "floor_wrong_target"
    }
    assert wrong["shapes@-1.5mm"] == "shapes-2@-1.5mm"
    assert wrong["shapes-2@1.5mm"] == "shapes@1.5mm"
    alone = {cell.method for task in tasks_of(write(tmp_path))["floor"] for cell in task.cells}
    assert "floor_wrong_target" not in alone


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    """The records of a study on a real bench, by label and target."""
    found = computed(write(tmp_path_factory.mktemp("focus")))
    return {(record["label"], record["cell"]["target"]): record for record in found}


def test_the_plane_of_the_display_scores_what_a_plain_picture_scores(records, tmp_path):
    alone = CONFIG[CONFIG.index("  - {name: multi") : CONFIG.index("headline")]
    config = write(tmp_path, ("measure: focus\n", ""), ("psnr_linear_infocus", "psnr_linear"), (alone, ""))
    pictures = {(r["label"], r["cell"]["target"]): r["scores"] for r in compute(config).records}
    place = ("wirtinger", "shapes@0mm")
    plain, found = pictures[place], records[place]["scores"]
    assert {name: found[name] for name in plain} == plain
    assert set(found) - set(plain) == {"psnr_linear_infocus", "ssim_linear_infocus"}


def test_a_hologram_of_all_planes_is_better_at_every_other_plane_than_one_of_the_middle(records):
    for target in ("shapes@-1.5mm", "shapes@1.5mm"):
        joint, moved, middle = (records[label, target]["scores"] for label in ("multi_plane", "wirtinger", "Middle"))
        for name in ("psnr_linear", "psnr_linear_infocus"):
            assert joint[name] > middle[name] + 1
        assert moved["psnr_linear"] > middle["psnr_linear"] + 3  # by a lens, more than the camera loses without one


def test_planes_of_a_scene_share_the_time_of_a_hologram_and_the_floor_is_scored_in_focus_too(records):
    floor = records["floor_constant", "shapes@0mm"]
    assert len({record["seconds"] for (label, _), record in records.items() if label == "multi_plane"}) == 1
    assert floor["scores"]["psnr_linear_infocus"] < 25
    assert floor["cell"]["condition"] == REFERENCE


def test_only_errors_in_focus_count_and_those_of_the_whole_picture_where_all_is():
    wanted, noise = torch.rand(2, 3, 40, 48, generator=torch.Generator().manual_seed(3))
    image = 3 * (wanted + 0.1 * noise)
    plain = score(image, wanted, metrics=["psnr", "ssim"])
    found = in_focus(image, wanted, torch.ones(40, 48, dtype=torch.bool))
    assert found == pytest.approx({f"{name}_infocus": plain[name] for name in ("psnr_linear", "ssim_linear")}, abs=1e-9)
    mask = torch.zeros(40, 48, dtype=torch.bool)
    with pytest.raises(CellError, match="nothing of this picture is in focus"):
        in_focus(image, wanted, mask)
    mask[:, :20] = True
    image = wanted.clone()
    image[:, :, 30:] = wanted[:, :, 30:].flip(-1)  # keeps the brightness nearly as it is
    good, bad = (in_focus(image, wanted, each) for each in (mask, ~mask))
    assert good["psnr_linear_infocus"] > bad["psnr_linear_infocus"] + 3
    assert good["ssim_linear_infocus"] > bad["ssim_linear_infocus"] + 0.1


REFUSED = [
    (("focal_stacks, params: {planes: [-1.5, 0, 1.5], blur: 0.03}", "charts"), "4:20: dataset 'charts' has no planes"),
    (("headline:", "sweeps: [{condition: defocus, values: [1]}]\nheadline:"), "9:10: a sweep changes simulated"),
    (("profiles: [ideal]", "learned: {method: hil, profile: ideal}"), "2:10: a learned display is a prediction"),
    (("measure: focus\n", ""), "8:11: unknown metric 'psnr_linear_infocus'"),
    (("planes: [-1.5, 0, 1.5]", "planes: [-1.5, 70]"), "4:51: dataset 'focal_stacks': parameter 'planes.1'"),
]


@pytest.mark.parametrize(("change", "message"), REFUSED)
def test_what_has_no_planes_is_refused_at_its_place(tmp_path, change, message):
    assert_refused(write(tmp_path, change), message)
