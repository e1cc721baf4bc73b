"""A panel whose phase has the other sign than stated is named where no fiducial grid is found."""

from dataclasses import replace
from pathlib import Path

import pytest

from holobench_eval.display.simulated.pipeline import SimulatedBench
from tests.lab.session.running import exported, told
from tests.support.photographing import Lab


def refused(folder: Path, profile: str, lab: Lab) -> str:
    """The one line with which the import of photographs from a lab ends."""
    session = exported(folder, "double_phase", profile)
    lab.photograph_round(session, 1)
    return told("import", session)[1]


@pytest.mark.parametrize("profile", ["leto-mild", "leto-aged"])  # without and with a ghost of the grid
def test_photographs_of_the_conjugate_pattern_name_the_sign(tmp_path: Path, profile: str) -> None:
    line = refused(tmp_path, profile, Lab(profile, (144, 144), seed=3, sign=-1))
    assert "the likely cause is the sign of the phase" in line
    assert "set phase.sign: -1 in the bench file" in line


def test_a_picture_that_is_out_of_focus_for_another_reason_does_not_name_the_sign(tmp_path: Path) -> None:
    lab = Lab("leto-mild", (144, 144), seed=3)
    panel = replace(lab.bench.profile.panel, distance=1.5 * lab.bench.profile.panel.distance)
    lab.bench = SimulatedBench(replace(lab.bench.profile, panel=panel))
    line = refused(tmp_path, "leto-mild", lab)
    assert "the photographs do not tell whether phase.sign: 1 is right" in line
