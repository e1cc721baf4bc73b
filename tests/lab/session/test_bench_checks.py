"""The checks of a live bench, made on the photographs of a session: one line each, and no score where one fails."""

import re
from pathlib import Path

from holobench_eval.lab.session.manifest import CHECKS, read_manifest
from tests.lab.session.running import exported, told
from tests.support.photographing import Lab

LAB = ("leto-mild", (144, 144), 4)
LATER = ("leto-mild", (144, 144), 5)  # another noise


def test_checks_come_before_any_score_and_may_be_photographed_again_until_they_pass(tmp_path: Path) -> None:
    session = exported(tmp_path, "double_phase", "leto-mild")
    Lab(*LAB).photograph_round(session, 1)
    for sign, gamma, words in (
        (-1, 1.0, "nothing was scored. phase convention: .* set phase.sign: -1"),
        (1, 0.8, "linearity: r^2 .* is there gamma"),
    ):
        Lab(*LATER, sign=sign).photograph_checks(session, gamma=gamma)
        assert re.search(words.replace("^", r"\^"), told("import", session)[1])
    Lab(*LATER).photograph_checks(session)
    photograph = next((session / "captures" / "checks").glob("*.png"))
    content = photograph.read_bytes()
    photograph.unlink()
    assert "checks: nothing was scored. missing: captures/checks/" in told("import", session)[1]
    assert not (session / "report" / "report.md").exists()
    photograph.write_bytes(content)
    said, failure = told("import", session)
    assert not failure
    lines = [line for line in said.splitlines() if "linearity:" in line or "phase convention:" in line]
    assert [line.split(":")[0] for line in lines] == ["channel 0", "channel 1", "channel 2", "phase convention"]
    assert all("r^2 1.0000" in line or "r^2 0.9999" in line for line in lines[:3])
    assert "upright" in lines[3]
    assert "phase convention: upright" in (session / "report" / "report.md").read_text().lower().replace("**", "")


def test_a_camera_with_one_exposure_checks_the_sign_alone(tmp_path: Path) -> None:
    folder = exported(tmp_path, "double_phase", "leto-mild", "--fixed-exposure")
    roles = [each.role for each in read_manifest(folder).of_round(CHECKS)]
    assert roles == [role for role in ("dark", "letter", "reversed") for _ in range(3)]
    Lab(*LATER).photograph_checks(folder)
    said, failure = told("import", folder)
    assert "linearity: not checked, since the session has one exposure" in said
    assert "phase convention:" in said
    assert "none of the" in failure
