"""Control in studies of predictions: a model that predicts a capture may yet not answer a change of the hologram."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.metrics.control import COLUMNS
from holobench_eval.study.config import load_study
from holobench_eval.study.plan import plan
from holobench_eval.study.scoring import prediction
from tests.support.studies import veiled
from tests.support.studies.trained_study import compute, computed, write

PREDICTION = ("seed: 3", "seed: 3\nmeasure: prediction\nholograms: {params: {iterations: 20}}")
NAMED = ("methods:", "protocol: {metrics: [psnr, control]}\nmethods:")
UNNAMED = ("methods:", "protocol: {metrics: [psnr]}\nmethods:")
METHODS = ('["trained.py:Gain"]', '["trained.py:Even", "veiled.py:Ideal", "veiled.py:Veil", "veiled.py:Tone"]')
PROFILES = ("{profiles: [ideal], panel: [128, 128]}", "{profiles: [ideal, veil.yaml], panel: [128, 128]}")
PROFILE = """\
name: veil
version: 1
seed: 0
description: An ideal display but for a veil.
panel:
  {shape: [128, 128], pitch: 6.4e-6, wavelengths: [6.36e-7, 5.17e-7, 4.46e-7], distance: 0.02, bits: 8, pupil: 0.8,
   region: 0.8125}
stray_light: {share: 0.6, reach: 0.2}
sensor: {pitch: 3.72e-6, noise: false}
"""


def study(folder: Path, *changes: tuple[str, str]) -> Path:
    shutil.copy(veiled.__file__, folder / "veiled.py")
    (folder / "veil.yaml").write_text(PROFILE)
    return write(folder, PREDICTION, METHODS, PROFILES, *changes)


@pytest.fixture(scope="module")
def scores(tmp_path_factory):
    """The scores of every model on both displays, of one target."""
    folder = tmp_path_factory.mktemp("control")
    records = computed(study(folder, NAMED))
    return {(record["label"], record["cell"]["condition"]): record["scores"] for record in records}


@pytest.mark.parametrize(("label", "display"), [("Ideal", "ideal"), ("Veil", "veil")])
def test_a_model_of_the_display_without_noise_has_nearly_full_control(scores, label, display):
    assert all(scores[label, display][name] > 0.95 for name in COLUMNS)


def test_a_model_that_predicts_the_same_whatever_is_shown_has_none(scores):
    assert [scores["Even", "veil"][name] for name in COLUMNS] == pytest.approx([0, 0, 0, 0, 1], abs=1e-9)


def test_a_tone_curve_predicts_a_veil_and_does_not_control_it(scores):
    tone, veil = scores["Tone", "veil"], scores["Veil", "veil"]
    assert tone["psnr_linear"] > 20
    assert 1 - tone["control_half"] > 20 * (1 - veil["control_half"])


def test_floor_images_answer_nothing_and_have_no_control(scores):
    floors = [found for (label, _), found in scores.items() if label.startswith("floor_")]
    assert floors
    assert not any(name.startswith("control") for found in floors for name in found)


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
    assert "control" not in plan(load_study(study(tmp_path))).metrics


PICTURES = (PREDICTION[1], "seed: 3"), (METHODS[1], "[wirtinger]")
MATCHED = (("panel: [128, 128]}", "panel: [128, 128], exposure: matched}"),)


@pytest.mark.parametrize(
    ("changes", "message"), [(PICTURES, "control is a score of models"), (MATCHED, "compares captures of equal light")]
)
def test_pictures_and_matched_light_have_no_control(tmp_path, changes, message):
    with pytest.raises(UserError, match=message):
        load_study(study(tmp_path, NAMED, *changes))


def test_holograms_that_do_not_follow_their_target_have_no_control(tmp_path):
    probe = ("holograms: {params: {iterations: 20}}", 'holograms: {name: "veiled.py:Ideal"}')
    records = compute(study(tmp_path, NAMED, probe, PROFILES[::-1])).records
    reasons = {record["reason"] for record in records if not record["label"].startswith("floor_")}
    assert reasons == {"veiled.py:Ideal has the same hologram for another target, so none has control"}
