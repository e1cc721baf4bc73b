"""Control in studies of predictions: what is changed of a hologram, and whether a model answers the change."""

import shutil
from pathlib import Path

import pytest
import torch
from torch import Tensor

from holobench_eval.core.errors import UserError
from holobench_eval.metrics.control import COLUMNS
from holobench_eval.study.config import load_study
from holobench_eval.study.scoring import prediction
from holobench_eval.study.scoring.changed import PHASE_RMS, changed_target, moved_phase
from tests.study.studies import planned, write_ideal_green
from tests.support.studies import veiled
from tests.support.studies.trained_study import compute, computed, write

PREDICTION = ("seed: 3", "seed: 3\nmeasure: prediction\nholograms: {params: {iterations: 20}}")
NAMED = ("methods:", "protocol: {metrics: [psnr, control]}\nmethods:")
UNNAMED = ("methods:", "protocol: {metrics: [psnr]}\nmethods:")
METHODS = ('["trained.py:Gain"]', '["trained.py:Even", "veiled.py:Ideal", "veiled.py:Veil", "veiled.py:Tone"]')
PROFILES = ("{profiles: [ideal], panel: [128, 128]}", "{profiles: [plain.yaml, veil.yaml]}")


def study(folder: Path, *changes: tuple[str, str]) -> Path:
    shutil.copy(veiled.__file__, folder / "veiled.py")
    write_ideal_green(folder, "plain", "sensor: {pitch: 3.72e-6, noise: false}")
    write_ideal_green(folder, "veil", "sensor: {pitch: 3.72e-6, noise: false}\nstray_light: {share: 0.6, reach: 0.2}")
    return write(folder, PREDICTION, METHODS, PROFILES, *changes)


@pytest.fixture(scope="module")
def scores(tmp_path_factory):
    """The scores of every model on both displays, of one target."""
    folder = tmp_path_factory.mktemp("control")
    records = computed(study(folder, NAMED))
    return {(record["label"], record["cell"]["condition"]): record["scores"] for record in records}


@pytest.mark.parametrize(("label", "display"), [("Ideal", "plain"), ("Veil", "veil")])
def test_a_model_of_the_display_without_noise_has_nearly_full_control(scores, label, display):
    assert all(scores[label, display][name] > 0.95 for name in COLUMNS)


def test_a_model_that_predicts_the_same_whatever_is_shown_has_none(scores):
    assert [scores["Even", "veil"][name] for name in COLUMNS] == pytest.approx([0, 0, 0, 0, 1], abs=1e-9)


def test_a_tone_curve_predicts_a_veil_and_does_not_control_it(scores):
    tone, veil = scores["Tone", "veil"], scores["Veil", "veil"]
    assert tone["psnr_linear"] > 20
    assert 1 - tone["control_half"] > 20 * (1 - veil["control_half"])


def test_floor_images_answer_nothing_and_have_no_control(scores):
    floors = [name for (label, _), found in scores.items() if label.startswith("floor_") for name in found]
    assert floors
    assert not any(name.startswith("control") for name in floors)


def test_control_is_added_to_what_was_predicted_before(tmp_path, monkeypatch, scores):
    models = METHODS[1], '["veiled.py:Veil"]'
    config = study(tmp_path, UNNAMED, models)
    before = compute(config)
    assert not any(name.startswith("control") for record in before.records for name in record["scores"])
    config = study(tmp_path, NAMED, models)
    rescored = compute(config, rescore=("control",))
    assert rescored.unscored == sum(not record["label"].startswith("floor_") for record in before.records)
    monkeypatch.setattr(prediction, "_photographs", type(prediction._photographs)())
    after = compute(config)
    assert [record["id"] for record in after.records] == [record["id"] for record in before.records]
    found = {(record["label"], record["cell"]["condition"]): record["scores"] for record in after.records}
    assert found == {name: scores[name] for name in found}
    assert compute(config).computed == 0


def test_a_study_that_names_no_metric_has_no_control(tmp_path):
    assert "control" not in planned(study(tmp_path)).metrics


def test_pictures_and_matched_light_have_no_control(tmp_path):
    pictures = (PREDICTION[1], "seed: 3"), (METHODS[1], "[wirtinger]")
    matched = (("veil.yaml]}", "veil.yaml], exposure: matched}"),)
    for changes, message in ((pictures, "control is a score of models"), (matched, "compares captures of equal light")):
        with pytest.raises(UserError, match=message):
            load_study(study(tmp_path, NAMED, *changes))


def test_holograms_that_do_not_follow_their_target_have_no_control(tmp_path):
    probe = ("holograms: {params: {iterations: 20}}", 'holograms: {name: "veiled.py:Ideal"}')
    records = compute(study(tmp_path, NAMED, probe, PROFILES[::-1])).records
    reasons = {record["reason"] for record in records if not record["label"].startswith("floor_")}
    assert reasons == {"veiled.py:Ideal has the same hologram for another target, so none has control"}


def picture(bright: int, height: int = 60, width: int = 90) -> Tensor:
    """Gray, and brighter in the left half (0) or in the right one (1)."""
    target = torch.full((3, height, width), 0.2)
    target[..., bright * width // 2 : (bright + 1) * width // 2] = 0.4
    return target


@pytest.mark.parametrize("bright", [0, 1])
def test_the_brighter_half_loses_its_light_and_the_other_none(bright):
    target = picture(bright)
    halves = changed_target(target, "half", 3, "t").split(45, dim=-1)
    assert not halves[bright].any()
    assert torch.equal(halves[1 - bright], torch.full((3, 60, 45), 0.2))
    assert torch.equal(target, picture(bright))


@pytest.mark.parametrize(("level", "expected"), [(0.2, 1.0), (0.9, 0.0)])
def test_a_patch_of_a_fifth_of_the_side_becomes_white_or_black_if_it_was_bright(level, expected):
    target = torch.full((3, 60, 90), level)
    changed = changed_target(target, "patch", 3, "t") != target
    assert changed.sum() == 3 * 12**2
    assert (changed_target(target, "patch", 3, "t")[changed] == expected).all()
    assert not torch.equal(changed, changed_target(target, "patch", 3, "another") != target)


def test_the_phase_moves_smoothly_in_the_middle_of_the_panel_alone_and_by_names():
    phase = torch.rand((3, 128, 192), dtype=torch.float64)
    before = phase.clone()
    move = moved_phase(phase, 3, "t") - phase
    middle = move[:, 32:96, 48:144]
    assert float(middle.square().mean().sqrt()) == pytest.approx(PHASE_RMS)
    assert float(move.square().sum()) == pytest.approx(float(middle.square().sum()))
    assert float(middle.diff(dim=-1).abs().max()) < 0.4
    assert torch.equal(move[0].round(decimals=9), move[2].round(decimals=9))
    assert torch.allclose(moved_phase(phase, 3, "t") - before, move)
    assert not torch.allclose(moved_phase(phase, 3, "another") - before, move)
