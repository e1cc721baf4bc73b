"""A change at test time costs a file with its Kind and a row of KINDS: studies then sweep it by its name."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import cast

import pytest

from holobench_eval.display import Profile
from holobench_eval.display.simulated.changes import KINDS
from holobench_eval.display.simulated.changes.kind import Kind, number
from holobench_eval.study.config import load_study
from holobench_eval.study.plan import plan

STUDY = """\
title: "Flicker after a year"
display: {profiles: [leto-mild], panel: [192, 192]}
targets: {dataset: charts, params: {names: [gray_ramp]}}
sweeps: [{condition: flicker, values: [0.01, 0.02]}]
methods: [wirtinger]
"""


def _flicker(profile: Profile, added: float) -> Profile:
    return replace(profile, flicker=replace(profile.flicker, rms=profile.flicker.rms + added))


def test_a_kind_and_a_row_make_a_change_that_a_study_can_sweep(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kind = Kind("flicker of the panel", "of the stroke", ("flicker",), number(_flicker), "added", low=0, high=0.1)
    monkeypatch.setitem(cast(dict[str, Kind], KINDS), "flicker", kind)
    (tmp_path / "study.yaml").write_text(STUDY)
    cells = plan(load_study(tmp_path / "study.yaml")).cells
    names = list(dict.fromkeys(cell.condition for cell in cells if cell.condition != "reference"))
    assert names == ["leto-mild", "leto-mild, flicker 0.01 of the stroke", "leto-mild, flicker 0.02 of the stroke"]
