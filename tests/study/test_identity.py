"""What is in the name of a phase, of a capture and of a score, and what is not."""

import json
import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.display import load_profile
from holobench_eval.methods.calibrated.parametric import ParametricModel
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.study import identity
from holobench_eval.study.artifacts import Artifacts
from holobench_eval.study.config import load_study
from holobench_eval.study.displays import Preparation
from holobench_eval.study.plan import Cell, Plan, plan
from holobench_eval.study.versions import GIVEN, GIVEN_GRAY
from tests.study.studies import exchanged, write_ideal
from tests.support.studies import another_metric, fake_trained

CONFIG = """\
title: "Names"
seed: 3
display: {profiles: [mine.yaml], panel: [128, 128]}
targets: {dataset: charts, params: {names: [tv_lines, gray_ramp]}}
training: {dataset: dead_leaves, params: {count: 3}, held_out: 1}
methods:
  - {name: METHOD, label: row}
"""
BLIND, CAMERA, PRIVILEGED, TRAINED = METHODS = ("wirtinger", "online_camera", "oracle", "double_phase_gamma")


def grid(folder: Path, method: str = BLIND, *changes: tuple[str, str]) -> Plan:
    """The plan of a study of one method, with pieces of its config exchanged."""
    if not (folder / "mine.yaml").exists():
        write_ideal(folder / "mine.yaml")
    (folder / "study.yaml").write_text(exchanged(CONFIG.replace("METHOD", method), *changes))
    planned = plan(load_study(folder / "study.yaml"))
    assert all(cell.id and cell.phase_id for cell in planned.cells)  # now, and not after the test has changed something
    return planned


def first(planned: Plan) -> Cell:
    """The first cell of a method."""
    return next(cell for cell in planned.cells if cell.code)


CHANGES = {
    "parameter": ("phase", "label: row", "params: {iterations: 7}, label: row"),
    "another parameter of the dataset": ("phase", "[tv_lines, gray_ramp]", "[tv_lines, siemens_star]"),
    "target": ("phase", "[tv_lines, gray_ramp]", "[gray_ramp, tv_lines]"),
    "size of the panel": ("phase", "[128, 128]", "[128, 160]"),
    "seed": ("phase", "seed: 3", "seed: 4"),
    "exposure": ("capture", "panel: [128, 128]", "panel: [128, 128], exposure: matched"),
    "exposure of the row": ("capture", "label: row", "label: row, exposure: matched"),
    "label": ("neither", "label: row", "label: another"),
    "title": ("neither", '"Names"', '"Others"'),
    "question": ("neither", "seed: 3", "seed: 3\nquestion: Is it so?\nwould_change: Another seed."),
    "metrics": ("neither", "seed: 3", "seed: 3\nprotocol: {metrics: [psnr, ssim, gmsd]}"),
    "headline": ("neither", "seed: 3", "seed: 3\nheadline: ssim_linear"),
    "what is kept": ("neither", "seed: 3", "seed: 3\nsave: {kept: false, phases: true}"),
    "where the method runs": ("neither", "seed: 3", "seed: 3\nisolation: none"),
    "further repeats": ("neither", "seed: 3", "seed: 3\nrepeats: 2"),
    "timing": ("neither", "seed: 3", "seed: 3\ntiming: alone"),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_what_a_method_is_given_names_its_phase_and_what_is_photographed_its_capture(tmp_path, change):
    names, *pieces = change
    for method in METHODS if names == "capture" else (BLIND,):
        before, after = grid(tmp_path, method), grid(tmp_path, method, (pieces[0], pieces[1]))
        assert (first(before).phase_id == first(after).phase_id) == (names != "phase")
        assert (first(before).id == first(after).id) == (names == "neither")
        if names == "neither":
            assert {cell.id for cell in before.cells} <= {cell.id for cell in after.cells}
            assert {cell.phase_id for cell in before.cells} <= {cell.phase_id for cell in after.cells}
    if names != "phase":  # nor does it make another training
        assert artifact_id(tmp_path, (pieces[0], pieces[1])) == artifact_id(tmp_path)


def test_another_version_or_method_makes_another_phase(tmp_path, monkeypatch):
    kinds = ("double_phase", "double_phase_aa", "double_phase_bl")
    assert len({first(grid(tmp_path, kind)).phase_id for kind in kinds}) == 3
    before = first(grid(tmp_path))
    assert before.phase["code"] == before.code
    monkeypatch.setattr(Wirtinger, "version", 77, raising=False)
    after = first(grid(tmp_path))
    assert before.phase_id != after.phase_id
    assert {**before.phase, "code": ""} == {**after.phase, "code": ""}


@pytest.mark.parametrize("optics", [("distance: 0.1 ", "distance: 0.2 "), ("pitch: 6.4e-6", "pitch: 8.0e-6")])
def test_other_nominal_optics_make_another_phase(tmp_path, optics):
    before = first(grid(tmp_path))
    write_ideal(tmp_path / "mine.yaml", optics)
    assert first(grid(tmp_path)).phase_id != before.phase_id


@pytest.mark.parametrize("method", METHODS)
def test_another_display_of_the_same_optics_makes_another_phase_where_it_is_seen(tmp_path, method):
    before = first(grid(tmp_path, method))
    for change in (("name: ideal", "name: another"), ("version: 1", "version: 2")):
        write_ideal(tmp_path / "mine.yaml", change)
        after = first(grid(tmp_path, method))
        assert before.id != after.id
        assert (before.phase_id == after.phase_id) == (method == BLIND)


@pytest.mark.parametrize("method", METHODS)
def test_a_new_bench_takes_all_captures_again_and_solves_again_what_captured_on_it(tmp_path, method, monkeypatch):
    before = grid(tmp_path, method)
    monkeypatch.setattr(identity, "PHOTOGRAPHS", "another")  # which are no matter to simulated displays
    assert [cell.id for cell in grid(tmp_path, method).cells] == [cell.id for cell in before.cells]
    monkeypatch.setattr(identity, "HARNESS", "another")
    after = grid(tmp_path, method)
    assert {cell.id for cell in before.cells}.isdisjoint(cell.id for cell in after.cells)
    assert (first(before).phase_id != first(after).phase_id) == (method in (CAMERA, PRIVILEGED))
    assert first(before).prepared == first(after).prepared


def test_another_training_makes_another_phase_of_what_learns_and_no_other(tmp_path):
    change = ("held_out: 1", "held_out: 2")
    for method in (BLIND, TRAINED):
        same = first(grid(tmp_path, method)).phase_id == first(grid(tmp_path, method, change)).phase_id
        assert same == (method == BLIND)


def described(**changes: Any) -> Mapping[str, Any]:
    spec = load_profile("ideal").spec((128, 128))
    given: dict[str, Any] = {"code": "Mine 1", "params": {}, "target": {"sha256": "0"}, "spec": spec}
    return identity.phase(**(given | {"draw": (1, "a", 0)} | changes))


def test_files_that_a_method_reads_and_what_it_learned_are_in_the_name_of_its_phase():
    plain = described()
    assert described(files={}, learned="", planes=[], display={}, captures=None, predicts=None) == plain
    assert described(files={"phases.npy": "1"}) != described(files={"phases.npy": "2"}) != plain
    assert described(files={"phases.npy": "missing"}) != plain
    assert described(learned="a") != described(learned="b") != plain
    assert "name" not in plain["optics"]


@pytest.mark.parametrize("measure", ["picture", "prediction", "focus"])
def test_another_metric_is_in_no_name_and_in_the_scores_of_the_plan(tmp_path, measure, monkeypatch):
    changes = {
        "picture": [("label: row", "label: row")],
        "prediction": [("seed: 3", "seed: 3\nmeasure: prediction"), ("wirtinger", "image_terms")],
        "focus": [
            ("seed: 3", "seed: 3\nmeasure: focus\nheadline: psnr_linear_infocus"),
            ("charts, params: {names: [tv_lines, gray_ramp]}", "focal_stacks, params: {planes: [0, 1.5]}"),
        ],
    }[measure]
    before = grid(tmp_path, BLIND, *changes)
    for version in (1, 2):
        another_metric.add(tmp_path, monkeypatch, version=version)
        after = grid(tmp_path, BLIND, *changes)
        assert after.metrics == {**before.metrics, another_metric.NAME: f"v2, {version}"}
        assert [cell.id for cell in after.cells] == [cell.id for cell in before.cells]
        assert [cell.phase_id for cell in after.cells] == [cell.phase_id for cell in before.cells]


def test_scores_are_grouped_by_the_metric_that_gives_them_and_columns_of_no_metric_by_the_match():
    given = {
        "psnr": {"psnr_linear": 1.0, "psnr_linear_blur0.5": 2.0},
        "ssim": {"ssim_srgb": 3.0},
        "ms_ssim": {"ms_ssim_linear": 4.0},
        "match": {"scale_0": 5.0, "brightness_ratio": 6.0, "scale_1": 5.5},
        "refine": {"refine_dx_px": 7.0},
        "infocus": {"psnr_linear_infocus": 8.0},
        "speckle_contrast": {"speckle_contrast": 9.0},
    }
    columns = {name: value for values in given.values() for name, value in values.items()}
    known = identity.versions()
    found = identity.grouped(columns, known)
    assert {name: entry["values"] for name, entry in found.items() if entry["values"]} == given
    assert identity.flat(found) == columns
    assert identity.flat(identity.grouped({"scale_0": 5.0}, known)) == {"match_factor": 5.0}
    assert identity.lacking(found, known) == {}
    old = {**found, "ssim": {"version": "v2, 0", "values": {"ssim_srgb": 3.0}}}
    assert identity.lacking(old, known) == {"ssim": known["ssim"]}
    assert identity.flat(old) == {name: value for name, value in columns.items() if name != "ssim_srgb"}
    nothing = identity.grouped({"psnr_linear": 1.0}, {name: known[name] for name in ("psnr", "speckle_contrast")})
    assert identity.lacking(nothing, {"speckle_contrast": known["speckle_contrast"]}) == {}  # it found none to measure


def test_a_display_of_one_wavelength_has_its_own_version_of_what_a_method_is_given():
    spec = load_profile("ideal").spec((128, 128))
    gray = replace(spec, wavelengths=spec.wavelengths[1:2])
    given = [identity.basis({}, each, ())["given"] for each in (spec, gray)]
    assert given == [GIVEN, GIVEN_GRAY]
    assert len(set(given)) == 2


LEARNS = "parametric_model"
ROW, IMAGES = "{name: parametric_model, label: row}", "params: {count: 3}, held_out: 1"


def needs(folder: Path, *changes: tuple[str, str]) -> list[Preparation]:
    """What has to be learned for a study of a trained method, with pieces of its config exchanged."""
    return list(grid(folder, LEARNS, *changes).preparations().values())


def artifact_id(folder: Path, *changes: tuple[str, str]) -> str:
    (needed,) = needs(folder, *changes)
    return needed.id


def test_what_a_state_depends_on_makes_another_artifact(tmp_path, monkeypatch):
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
    found = [artifact_id(tmp_path), *(artifact_id(tmp_path, change) for change in changes)]
    for change in ("version: 1", "version: 2"), ("5.17e-7", "5.32e-7"), ("noise: false", "noise: true"):
        write_ideal(tmp_path / "mine.yaml", change)
        found.append(artifact_id(tmp_path))
    write_ideal(tmp_path / "mine.yaml")
    monkeypatch.setattr(ParametricModel, "version", 99)
    found.append(artifact_id(tmp_path))
    assert len(set(found)) == len(found)


def test_targets_measures_and_other_methods_make_no_other_artifact(tmp_path):
    targets, measure = ("[tv_lines, gray_ramp]", "[tv_lines]"), ("seed: 3", "seed: 3\nmeasure: prediction")
    for change in (targets, measure, (ROW, f"{ROW}\n  - wirtinger")):
        assert artifact_id(tmp_path, change) == artifact_id(tmp_path)


def test_every_display_is_learned_for_itself_and_once(tmp_path):
    planned = grid(tmp_path, LEARNS, ("[mine.yaml]", "[ideal, leto-mild]"))
    assert sorted(needed.display.name for needed in planned.preparations().values()) == ["ideal", "leto-mild"]
    for task in planned.tasks:
        if not task.is_floor:
            assert task.preparation is not None
            assert [cell.prepared for cell in task.cells] == [(task.preparation.id,)]
            assert task.preparation.display.name == task.conditions[0].name


def test_a_description_is_plain_has_the_version_and_names_a_folder_inside_that_of_the_artifacts(tmp_path):
    write_ideal(tmp_path / "mine.yaml", ("name: ideal", 'name: "../../up"'))
    (needed,) = needs(tmp_path)
    assert json.loads(json.dumps(needed.description())) == needed.description()
    assert needed.description()["version"] == f"ParametricModel {ParametricModel.version}"
    assert Artifacts(tmp_path / "artifacts").folder_of(needed).parent == tmp_path / "artifacts"


def test_images_that_nobody_trains_on_may_be_scored(tmp_path):
    targets = "charts, params: {names: [tv_lines, gray_ramp]}"
    planned = grid(tmp_path, BLIND, ("dead_leaves, params: {count: 3}", targets))
    assert planned.cells
    assert not planned.preparations()


def test_held_out_images_leave_some_to_train_on(tmp_path):
    with pytest.raises(UserError, match=r"study\.yaml:5:\d+: training\.held_out 3 leaves nothing of 3 images"):
        grid(tmp_path, LEARNS, ("held_out: 1", "held_out: 3"))
