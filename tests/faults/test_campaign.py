"""A study that is hit by faults becomes what it is without one; ``python -m tests.faults`` does the same for long."""

import os
import random
from pathlib import Path

import pytest

from tests.faults.campaign import KINDS, Count, study, without_fault

ELSEWHERE = {  # what goes the way of a fault that is tried here, or is shown by a test of its own
    "the run is told to end",
    "the run is interrupted",  # tests/study/running/test_kill_and_resume.py
    "the run is killed",
    "a worker or a method's process aborts",
    "a call of a method is stopped",  # tests/cheats
    "the Dask scheduler is killed",  # tests/study/executors/test_clusters.py
    "the panel vanishes",
    "the run on devices is killed",
    "a file of the results on devices is damaged",
}


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are found in /proc")
@pytest.mark.parametrize("kind", KINDS, ids=["simulated", "devices", "captures"])
def test_a_study_that_is_hit_by_faults_ends_as_one_without(tmp_path, kind):
    names = [name for name in kind.faults if name not in ELSEWHERE]
    names = [name for name in names if name != "the disk is full" or os.geteuid() == 0]
    seen = Count()
    study(tmp_path / "hit", random.Random(1), names, without_fault(kind, tmp_path / "without"), seen)
    assert sum(seen.faults.values()) + seen.late == len(names)
    assert seen.faults
    assert (seen.lost, seen.doubled, seen.wrong, seen.tables) == (0, 0, 0, 0)
    assert seen.counted > 0
    assert seen.miscounted == 0
    assert (seen.hung, seen.holes, seen.tracebacks) == (0, 0, 0), seen.told
