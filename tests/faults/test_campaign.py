"""A study that is hit by every kind of fault becomes what it is without one."""

from __future__ import annotations

import os
import random
from pathlib import Path

import pytest

from tests.faults.campaign import KINDS, Count, Kind, study, without_fault


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are found in /proc")
@pytest.mark.parametrize("kind", KINDS, ids=["simulated", "devices"])
def test_a_study_that_is_hit_by_every_fault_ends_as_one_without(tmp_path: Path, kind: Kind) -> None:
    names = [name for name in kind.faults if name != "the disk is full" or os.geteuid() == 0]
    seen = Count()
    study(tmp_path / "hit", random.Random(1), names, without_fault(kind, tmp_path / "without"), seen)
    assert sum(seen.faults.values()) + seen.late == len(names)
    assert (seen.lost, seen.doubled, seen.wrong, seen.tables) == (0, 0, 0, 0)
    assert seen.counted > 0
    assert seen.miscounted == 0
    assert (seen.hung, seen.holes, seen.tracebacks) == (0, 0, 0), seen.told
