"""What is in the name of a phase, of a capture and of a score, and what is not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest

from holobench_eval.display import load_profile
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.study import identity
from holobench_eval.study.config import load_study
from holobench_eval.study.plan import Cell, Plan, plan
from holobench_eval.study.versions import GIVEN, GIVEN_GRAY
from tests.study.studies import exchanged
from tests.support import another_metric

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


def write_profile(folder: Path, file: str = "mine.yaml", *changes: tuple[str, str]) -> None:
    """The ideal profile in a file, with pieces exchanged."""
    text = files("holobench_eval.display.simulated").joinpath("profiles", "ideal.yaml").read_text()
    (folder / file).write_text(exchanged(text, *changes))


def grid(folder: Path, method: str = BLIND, *changes: tuple[str, str]) -> Plan:
    """The plan of a study of one method, with pieces of its config exchanged."""
    if not (folder / "mine.yaml").exists():
        write_profile(folder)
    (folder / "study.yaml").write_text(exchanged(CONFIG.replace("METHOD", method), *changes))
    planned = plan(load_study(folder / "study.yaml"))
    assert all(cell.id and cell.phase_id for cell in planned.cells)  # now, and not after the test has changed something
    return planned


def first(planned: Plan) -> Cell:
    """The first cell of a method."""
    return next(cell for cell in planned.cells if cell.code)


PHASE = {
    "parameter": ("label: row", "params: {iterations: 7}, label: row"),
    "another parameter of the dataset": ("[tv_lines, gray_ramp]", "[tv_lines, siemens_star]"),
    "target": ("[tv_lines, gray_ramp]", "[gray_ramp, tv_lines]"),
    "size of the panel": ("[128, 128]", "[128, 160]"),
    "seed": ("seed: 3", "seed: 4"),
}
CAPTURE = {
    "exposure": ("panel: [128, 128]", "panel: [128, 128], exposure: matched"),
    "exposure of the row": ("label: row", "label: row, exposure: matched"),
}
NEITHER = {
    "label": ("label: row", "label: another"),
    "title": ('"Names"', '"Others"'),
    "question": ("seed: 3", "seed: 3\nquestion: Is it so?\nwould_change: Another seed."),
    "metrics": ("seed: 3", "seed: 3\nprotocol: {metrics: [psnr, ssim, gmsd]}"),
    "headline": ("seed: 3", "seed: 3\nheadline: ssim_linear"),
    "what is kept": ("seed: 3", "seed: 3\nsave: {kept: false, phases: true}"),
    "where the method runs": ("seed: 3", "seed: 3\nisolation: none"),
    "further repeats": ("seed: 3", "seed: 3\nrepeats: 2"),
    "timing": ("seed: 3", "seed: 3\ntiming: alone"),
}


@pytest.mark.parametrize("change", PHASE.values(), ids=PHASE)
def test_what_a_method_is_given_makes_another_phase_and_so_another_capture(
    tmp_path: Path, change: tuple[str, str]
) -> None:
    before, after = first(grid(tmp_path)), first(grid(tmp_path, BLIND, change))
    assert before.phase_id != after.phase_id
    assert before.id != after.id


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("change", CAPTURE.values(), ids=CAPTURE)
def test_how_it_is_photographed_makes_another_capture_of_the_same_phase(
    tmp_path: Path, method: str, change: tuple[str, str]
) -> None:
    before, after = first(grid(tmp_path, method)), first(grid(tmp_path, method, change))
    assert before.phase_id == after.phase_id
    assert before.id != after.id


@pytest.mark.parametrize("change", NEITHER.values(), ids=NEITHER)
def test_what_changes_no_photograph_is_in_no_name(tmp_path: Path, change: tuple[str, str]) -> None:
    before, after = grid(tmp_path), grid(tmp_path, BLIND, change)
    assert {cell.id for cell in before.cells} <= {cell.id for cell in after.cells}
    assert {cell.phase_id for cell in before.cells} <= {cell.phase_id for cell in after.cells}


def test_every_repeat_has_a_phase_of_its_own(tmp_path: Path) -> None:
    repeats = [cell for cell in grid(tmp_path, BLIND, ("seed: 3", "seed: 3\nrepeats: 3")).cells if cell.code]
    assert len({cell.phase_id for cell in repeats}) == len(repeats) == 2 * 3


def test_another_version_of_a_method_makes_another_phase(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = first(grid(tmp_path))
    assert before.phase["code"] == before.code
    monkeypatch.setattr(Wirtinger, "version", 77, raising=False)
    after = first(grid(tmp_path))
    assert before.phase_id != after.phase_id
    assert {**before.phase, "code": ""} == {**after.phase, "code": ""}


def test_methods_of_the_same_code_have_phases_of_their_own(tmp_path: Path) -> None:
    """As those of one file have it, and the three kinds of double phase."""
    kinds = ("double_phase", "double_phase_aa", "double_phase_bl")
    assert len({first(grid(tmp_path, kind)).phase_id for kind in kinds}) == 3


@pytest.mark.parametrize("optics", [("distance: 0.1 ", "distance: 0.2 "), ("pitch: 6.4e-6", "pitch: 8.0e-6")])
def test_other_nominal_optics_make_another_phase(tmp_path: Path, optics: tuple[str, str]) -> None:
    before = first(grid(tmp_path))
    write_profile(tmp_path, "mine.yaml", optics)
    assert first(grid(tmp_path)).phase_id != before.phase_id


DISPLAYS = {"name": ("name: ideal", "name: another"), "version": ("version: 1", "version: 2")}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("change", DISPLAYS.values(), ids=DISPLAYS)
def test_another_display_of_the_same_optics_makes_another_capture_and_another_phase_where_it_is_seen(
    tmp_path: Path, method: str, change: tuple[str, str]
) -> None:
    before = first(grid(tmp_path, method))
    write_profile(tmp_path, "mine.yaml", change)
    after = first(grid(tmp_path, method))
    assert before.id != after.id
    assert (before.phase_id == after.phase_id) == (method == BLIND)


@pytest.mark.parametrize("method", METHODS)
def test_a_new_bench_takes_all_captures_again_and_solves_again_what_captured_on_it(
    tmp_path: Path, method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = grid(tmp_path, method)
    captures = {cell.id for cell in before.cells}
    monkeypatch.setattr(identity, "HARNESS", "another")
    after = grid(tmp_path, method)
    assert captures.isdisjoint(cell.id for cell in after.cells)
    assert (first(before).phase_id != first(after).phase_id) == (method in (CAMERA, PRIVILEGED))
    assert first(before).prepared == first(after).prepared


def test_how_photographs_of_displays_that_exist_are_scored_is_no_matter_to_simulated_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = [cell.id for cell in grid(tmp_path).cells]
    monkeypatch.setattr(identity, "PHOTOGRAPHS", "another")
    assert [cell.id for cell in grid(tmp_path).cells] == before


def test_another_training_makes_another_phase_of_what_learns_and_no_other(tmp_path: Path) -> None:
    change = ("held_out: 1", "held_out: 2")
    for method in (BLIND, TRAINED):
        same = first(grid(tmp_path, method)).phase_id == first(grid(tmp_path, method, change)).phase_id
        assert same == (method == BLIND)


def described(**changes: Any) -> Mapping[str, Any]:
    spec = load_profile("ideal").spec((128, 128))
    given: dict[str, Any] = {"code": "Mine 1", "params": {}, "target": {"sha256": "0"}, "spec": spec}
    return identity.phase(**(given | {"draw": (1, "a", 0)} | changes))


def test_files_that_a_method_reads_and_what_it_learned_are_in_the_name_of_its_phase_and_nothing_else_costs_one() -> (
    None
):
    plain = described()
    assert described(files={}, learned="", planes=[], display={}, captures=None, predicts=None) == plain
    assert described(files={"phases.npy": "1"}) != described(files={"phases.npy": "2"}) != plain
    assert described(files={"phases.npy": "missing"}) != plain
    assert described(learned="a") != described(learned="b") != plain
    assert "name" not in plain["optics"]


@pytest.mark.parametrize("measure", ["picture", "prediction", "focus"])
def test_a_metric_more_is_in_no_name_and_in_the_scores_of_the_plan(
    tmp_path: Path, measure: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    changes = {
        "picture": [("label: row", "label: row")],
        "prediction": [("seed: 3", "seed: 3\nmeasure: prediction"), ("wirtinger", "image_terms")],
        "focus": [
            ("seed: 3", "seed: 3\nmeasure: focus\nheadline: psnr_linear_infocus"),
            ("charts, params: {names: [tv_lines, gray_ramp]}", "focal_stacks, params: {planes: [0, 1.5]}"),
        ],
    }[measure]
    before = grid(tmp_path, BLIND, *changes)
    another_metric.add(tmp_path, monkeypatch)
    after = grid(tmp_path, BLIND, *changes)
    assert after.metrics == {**before.metrics, another_metric.NAME: "v2, 1"}
    assert [cell.id for cell in after.cells] == [cell.id for cell in before.cells]
    assert [cell.phase_id for cell in after.cells] == [cell.phase_id for cell in before.cells]


def test_a_metric_of_another_version_is_in_no_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    another_metric.add(tmp_path, monkeypatch)
    before = grid(tmp_path)
    another_metric.add(tmp_path, monkeypatch, version=2)
    after = grid(tmp_path)
    assert after.metrics == {**before.metrics, another_metric.NAME: "v2, 2"}
    assert [cell.id for cell in after.cells] == [cell.id for cell in before.cells]


def test_scores_are_grouped_by_the_metric_that_gives_them_and_columns_of_no_metric_by_the_match() -> None:
    columns = {
        **{"psnr_linear": 1.0, "psnr_linear_blur0.5": 2.0, "ssim_srgb": 3.0, "ms_ssim_linear": 4.0, "scale_0": 5.0},
        **{
            "brightness_ratio": 6.0,
            "refine_dx_px": 7.0,
            "psnr_linear_infocus": 8.0,
            "speckle_contrast": 9.0,
            "scale_1": 5.5,
        },
    }
    known = identity.versions()
    found = identity.grouped(columns, known)
    assert {name: entry["values"] for name, entry in found.items() if entry["values"]} == {
        "psnr": {"psnr_linear": 1.0, "psnr_linear_blur0.5": 2.0},
        "ssim": {"ssim_srgb": 3.0},
        "ms_ssim": {"ms_ssim_linear": 4.0},
        "match": {"scale_0": 5.0, "brightness_ratio": 6.0, "scale_1": 5.5},
        "refine": {"refine_dx_px": 7.0},
        "infocus": {"psnr_linear_infocus": 8.0},
        "speckle_contrast": {"speckle_contrast": 9.0},
    }
    assert identity.flat(found) == columns
    gray = identity.grouped({"scale_0": 5.0}, known)
    assert identity.flat(gray) == {"match_factor": 5.0}
    assert identity.lacking(found, known) == {}
    old = {**found, "ssim": {"version": "v2, 0", "values": {"ssim_srgb": 3.0}}}
    assert identity.lacking(old, known) == {"ssim": known["ssim"]}
    assert identity.flat(old) == {name: value for name, value in columns.items() if name != "ssim_srgb"}


def test_a_metric_that_found_nothing_to_measure_is_not_lacking() -> None:
    known = identity.versions()
    found = identity.grouped({"psnr_linear": 1.0}, {name: known[name] for name in ("psnr", "speckle_contrast")})
    assert identity.lacking(found, {"speckle_contrast": known["speckle_contrast"]}) == {}


def test_a_display_of_one_wavelength_has_its_own_version_of_what_a_method_is_given() -> None:
    spec = load_profile("ideal").spec((128, 128))
    gray = replace(spec, wavelengths=spec.wavelengths[1:2])
    given = [identity.basis({}, each, ())["given"] for each in (spec, gray)]
    assert given == [GIVEN, GIVEN_GRAY]
    assert len(set(given)) == 2
