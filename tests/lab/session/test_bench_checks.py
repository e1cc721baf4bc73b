"""The checks of a live bench, made on the photographs of a session: one line each, and no score where one fails."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from holobench_eval.lab.session.manifest import CHECKS, read_manifest
from tests.lab.session.running import exported, told
from tests.support.photographing import Lab

STUDY = """\
title: Checked first
display: {profiles: [leto-mild], panel: [144, 144]}
targets: {dataset: photographs, params: {count: 1}}
methods: [double_phase]
protocol: {metrics: [psnr]}
"""
LAB = ("leto-mild", (144, 144), 4)
LATER = ("leto-mild", (144, 144), 5)  # another noise


@pytest.fixture(scope="module")
def photographed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = exported(tmp_path_factory.mktemp("checks"), STUDY)
    Lab(*LAB).photograph_round(folder, 1)
    return folder


@pytest.fixture
def session(photographed: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(photographed, tmp_path / "bench"))


def test_checks_that_pass_are_a_line_each_in_the_import_and_in_the_report(session: Path) -> None:
    Lab(*LATER).photograph_checks(session)
    said, failure = told("import", session)
    assert not failure
    lines = [line for line in said.splitlines() if "linearity:" in line or "phase convention:" in line]
    assert [line.split(":")[0] for line in lines] == ["channel 0", "channel 1", "channel 2", "phase convention"]
    assert all("r^2 1.0000" in line or "r^2 0.9999" in line for line in lines[:3])
    assert "upright" in lines[3]
    assert "phase convention: upright" in (session / "report" / "report.md").read_text().lower().replace("**", "")


def test_a_reversed_sign_is_named_before_anything_is_scored(session: Path) -> None:
    Lab(*LATER, sign=-1).photograph_checks(session)
    _, failure = told("import", session)
    assert "nothing was scored" in failure
    assert "set phase.sign: -1" in failure


def test_a_camera_that_is_not_linear_is_refused_and_its_checks_may_be_photographed_again(session: Path) -> None:
    Lab(*LATER).photograph_checks(session, gamma=0.8)
    _, failure = told("import", session)
    assert "linearity: r^2" in failure
    assert "is there gamma" in failure
    Lab(*LATER).photograph_checks(session)
    assert not told("import", session)[1]


def test_checks_that_were_left_out_are_told_and_a_part_of_them_is_refused(session: Path) -> None:
    said, failure = told("import", session)
    assert not failure
    assert "checks: not photographed" in said
    Lab(*LATER).photograph_checks(session)
    next((session / "captures" / "checks").glob("*.png")).unlink()
    assert "checks: nothing was scored. missing: captures/checks/" in told("import", session)[1]


def test_a_camera_with_one_exposure_checks_the_sign_alone(tmp_path: Path) -> None:
    folder = exported(tmp_path, STUDY, "--fixed-exposure")
    roles = [each.role for each in read_manifest(folder).of_round(CHECKS)]
    assert roles == [role for role in ("dark", "letter", "reversed") for _ in range(3)]
    Lab(*LATER).photograph_checks(folder)
    said, failure = told("import", folder)
    assert "linearity: not checked, since the session has one exposure" in said
    assert "phase convention:" in said
    assert "none of the" in failure
