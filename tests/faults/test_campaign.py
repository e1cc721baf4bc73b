"""A study that is hit by every kind of fault becomes what it is without one."""

from __future__ import annotations

import os
import random
from pathlib import Path

import pytest

from tests.faults.campaign import FAULTS, Count, study, without_fault


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are found in /proc")
def test_a_study_that_is_hit_by_every_fault_ends_as_one_without(tmp_path: Path) -> None:
    names = [name for name in FAULTS if name != "the disk is full" or os.geteuid() == 0]
    wanted, length = without_fault(tmp_path / "without")
    seen = Count()
    study(tmp_path / "hit", random.Random(1), names, length, wanted, seen)
    assert sum(seen.faults.values()) == len(names)
    assert (seen.lost, seen.doubled, seen.wrong, seen.tables, seen.hung, seen.holes) == (0, 0, 0, 0, 0, 0)
