from collections import OrderedDict
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from holobench_eval.study import cost
from holobench_eval.study.scoring import prediction as predicting
from tests.study.studies import assert_refused, planned
from tests.support.studies.trained_study import compute, computed, write

PREDICTION = ("seed: 3", "seed: 3\nmeasure: prediction\nholograms: {params: {iterations: 3}}")
METHODS = ('["trained.py:Gain"]', '["trained.py:Gain", "trained.py:Even"]')


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    """The records of a prediction study on a real bench, by label."""
    folder = tmp_path_factory.mktemp("prediction")
    config = write(folder, PREDICTION, METHODS, ("count: 1", "count: 2"))
    return {record["label"]: record for record in computed(config) if record["cell"]["target"] == "picture 0"}


def test_the_ideal_image_predicts_the_capture_of_an_ideal_display(records):
    scores = records["Gain"]["scores"]
    assert scores["psnr_linear"] > 30
    assert scores["ssim_linear"] > 0.9
    assert records["Gain"]["learned"]["captures"] == 2
    assert [scores[f"scale_{channel}"] for channel in range(3)] == pytest.approx([1] * 3, abs=0.1)


def test_even_light_scores_what_the_floor_says_of_the_same_capture(records):
    even, floor = records["Even"]["scores"], records["floor_constant"]["scores"]
    for name in ("psnr_linear", "ssim_linear", "psnr_srgb"):
        assert even[name] == pytest.approx(floor[name], abs=1e-4)
    assert records["Even"]["learned"] is None
    assert records["Gain"]["scores"]["psnr_linear"] > floor["psnr_linear"] + 5


def test_the_floor_compares_with_the_capture_not_the_target_and_the_wrong_target_is_another_capture(records, tmp_path):
    pictures = compute(write(tmp_path, ('["trained.py:Gain"]', '["trained.py:Even"]'))).records
    floor = {record["label"]: record["scores"] for record in pictures}
    for name in ("floor_black", "floor_shift_1px"):
        assert records[name]["scores"]["psnr_linear"] != pytest.approx(floor[name]["psnr_linear"], abs=1e-3)
    assert records["floor_wrong_target"]["scores"]["psnr_linear"] < 40  # 80 dB where it is the same capture


def test_cells_of_predictions_name_the_hologram_and_are_no_cells_of_pictures(tmp_path):
    other = PREDICTION[0], PREDICTION[1].replace("3}", "4}")
    grids = [planned(write(tmp_path, *change)) for change in ((), (PREDICTION,), (other,))]
    pictures, cells, others = (grid.cells for grid in grids)
    assert cost.key(grids[0].tasks[-1], 1, 1) != cost.key(grids[1].tasks[-1], 1, 1)  # nor is the time the same
    assert len({cell.id for cell in (*pictures, *cells, *others)}) == len(pictures) + len(cells) + len(others)
    assert (cells[-1].holograms["name"], cells[-1].holograms["params"]["iterations"]) == ("wirtinger", 3)


REFUSED = [
    ("measure: prediction", '["trained.py:Gain", wirtinger]', "7:30: method 'wirtinger' predicts no captures"),
    ('holograms: {name: "trained.py:Gain"}', '["trained.py:Gain"]', "3:19: method 'trained.py:Gain' has to be trained"),
    ("holograms: {params: {iteration: 3}}", "[wirtinger]", "3:22: method 'wirtinger' has no parameter 'iteration'"),
]


@pytest.mark.parametrize(("line", "methods", "message"), REFUSED)
def test_what_cannot_be_predicted_is_refused_in_place(tmp_path, line, methods, message):
    config = write(tmp_path, ("seed: 3", f"seed: 3\n{line}"), ('["trained.py:Gain"]', methods))
    assert_refused(config, message)


def test_a_prediction_of_another_shape_is_a_failed_cell(tmp_path, no_physics):
    config = write(tmp_path, PREDICTION, ("trained.py:Gain", "narrow.py:Even"))
    plugins = (tmp_path / "trained.py").read_text()
    (tmp_path / "narrow.py").write_text(plugins.replace("*bench.spec.region.shape)", "5, 5)"))
    reason = compute(config).records[-1]["reason"]
    assert reason == "Even: predict returned (1, 3, 5, 5), not an image (1, 3, 104, 104)"


@pytest.mark.parametrize("measure", ["picture", "prediction"])
def test_only_the_metrics_that_a_study_names_are_computed(tmp_path, measure):
    kind = PREDICTION if measure == "prediction" else ("", "")
    named = ("methods:", "protocol: {metrics: [psnr, speckle_contrast]}\nmethods:")
    records = compute(write(tmp_path, METHODS, named, kind)).records
    assert {record["state"] for record in records} == {"done"}
    assert {*planned(tmp_path / "study.yaml").metrics} == {"psnr", "speckle_contrast", "match", "refine"}
    scores = {key for record in records for key in record["scores"]}
    assert {"psnr_linear", "psnr_srgb"} <= scores
    assert not any(name in key for key in scores for name in ("ssim", "mofd", "flip", "vsi"))


def test_the_hologram_of_a_probe_whose_code_changed_is_another(monkeypatch):
    solved: list[Any] = []
    bench = SimpleNamespace(photograph=lambda phase, *_, **__: None)
    monkeypatch.setattr(predicting, "_photographs", OrderedDict())
    monkeypatch.setattr(predicting.opening, "open_display", lambda *_: bench)

    def solve(job: Any, cell: Any, display: Any) -> Any:
        solved.append(cell.holograms["phase"]["code"])
        return SimpleNamespace(phase=None, covered={})

    monkeypatch.setattr(predicting, "_solved", solve)
    setting = SimpleNamespace(study=SimpleNamespace(folder=Path()))
    job: Any = SimpleNamespace(target=lambda cell, display: None, device="cpu", setting=setting)
    display: Any = "a display"
    for version in ("before", "before", "after"):
        probe = {"name": "mine.py:Mine", "params": {}, "code": version, "phase": {"code": version}}
        cell: Any = SimpleNamespace(holograms=probe, repeat=0, seed=1, exposure="equal", target="tv_lines")
        predicting.shown(job, cell, display)
    assert solved == ["before", "after"]
