"""The captures that are reported after faults are those that were taken."""

from __future__ import annotations

from pathlib import Path

import pytest

from holobench_eval.study.executors.processes import FORKS
from tests.faults.captures import KINDS, campaign


@pytest.mark.slow
@pytest.mark.skipif(not FORKS, reason="each of many processes would import torch")
def test_captures_that_are_reported_after_faults_were_taken(tmp_path: Path) -> None:
    seen = campaign(tmp_path, seed=5, faults=5, isolations=("none",))
    assert seen.wrong == []
    assert seen.faults.keys() == KINDS.keys()
    assert all(seen.faults.values())
    assert seen.budgets
