"""The checks of a live bench, made on the photographs of a session: one line each, and no score where one fails."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from holobench_eval.commands import app
from holobench_eval.core.errors import UserError
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
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("checks")
    (folder / "study.yaml").write_text(STUDY)
    done = CliRunner().invoke(app, ["session", "export", str(folder / "study.yaml"), str(folder / "bench")])
    assert done.exit_code == 0, (done.output, done.exception)
    Lab(*LAB).photograph_round(folder / "bench", 1)
    return folder / "bench"


@pytest.fixture
def session(exported: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(exported, tmp_path / "bench"))


def imported(folder: Path) -> tuple[str, str]:
    """What an import says, and the line with which it ends."""
    done = CliRunner().invoke(app, ["session", "import", str(folder)])
    assert done.exit_code == 0 or isinstance(done.exception, UserError), (done.output, done.exception)
    assert "\n" not in str(done.exception)
    return done.output, str(done.exception or "")


def test_checks_that_pass_are_a_line_each_in_the_import_and_in_the_report(session: Path) -> None:
    Lab(*LATER).photograph_checks(session)
    said, failure = imported(session)
    assert not failure
    lines = [line for line in said.splitlines() if "linearity:" in line or "phase convention:" in line]
    assert [line.split(":")[0] for line in lines] == ["channel 0", "channel 1", "channel 2", "phase convention"]
    assert all("r^2 1.0000" in line or "r^2 0.9999" in line for line in lines[:3])
    assert "upright" in lines[3]
    assert "phase convention: upright" in (session / "report" / "report.md").read_text().lower().replace("**", "")


def test_a_reversed_sign_is_named_before_anything_is_scored(session: Path) -> None:
    Lab(*LATER, sign=-1).photograph_checks(session)
    _, failure = imported(session)
    assert "nothing was scored" in failure
    assert "set phase.sign: -1" in failure


def test_a_camera_that_is_not_linear_is_refused_and_its_checks_may_be_photographed_again(session: Path) -> None:
    Lab(*LATER).photograph_checks(session, gamma=0.8)
    _, failure = imported(session)
    assert "linearity: r^2" in failure
    assert "is there gamma" in failure
    Lab(*LATER).photograph_checks(session)
    assert not imported(session)[1]


def test_checks_that_were_left_out_are_told_and_a_part_of_them_is_refused(session: Path) -> None:
    said, failure = imported(session)
    assert not failure
    assert "checks: not photographed" in said
    Lab(*LATER).photograph_checks(session)
    next((session / "captures" / "checks").glob("*.png")).unlink()
    assert "checks: nothing was scored. missing: captures/checks/" in imported(session)[1]


def test_a_camera_with_one_exposure_checks_the_sign_alone(tmp_path: Path) -> None:
    (tmp_path / "study.yaml").write_text(STUDY)
    done = CliRunner().invoke(
        app, ["session", "export", str(tmp_path / "study.yaml"), str(tmp_path / "bench"), "--fixed-exposure"]
    )
    assert done.exit_code == 0
    patterns = json.loads((tmp_path / "bench" / "manifest.json").read_text())["patterns"]
    assert [each["role"] for each in patterns if each["round"] == 0] == [
        *["dark"] * 3,
        *["letter"] * 3,
        *["reversed"] * 3,
    ]
    Lab(*LATER).photograph_checks(tmp_path / "bench")
    said, failure = imported(tmp_path / "bench")
    assert "linearity: not checked, since the session has one exposure" in said
    assert "phase convention:" in said
    assert "none of the" in failure
