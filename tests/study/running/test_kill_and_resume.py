from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest

from tests.study.studies import compute, compute_faked
from tests.support.patience import PATIENCE, killed_at, wait_until
from tests.support.studies import fake_study
from tests.support.studies.fake_study import held, solves, untimed, write_config

TARGETS = 5


@pytest.mark.slow
@pytest.mark.usefixtures("no_physics")
def test_a_run_that_was_killed_and_interrupted_gives_the_records_of_one_that_was_not(tmp_path):
    config, output = write_config(tmp_path, count=TARGETS), tmp_path / "out"

    with held(tmp_path, 1):
        killed_at(lambda: len(solves(tmp_path)) >= 2, compute_faked, config, output)

    with held(tmp_path, 3):
        command = [sys.executable, fake_study.__file__, "run", str(config), "--output", str(output)]
        stopped = subprocess.Popen(
            [*command, "--executor", "serial", "--threads", "1"],
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ | {"MPLBACKEND": "agg"},
        )
        wait_until(lambda: len(solves(tmp_path)) >= 5)
        stopped.send_signal(signal.SIGINT)
        _, err = stopped.communicate(timeout=PATIENCE)
    assert stopped.returncode == 130
    assert "resume with the same command" in err
    assert "Traceback" not in err

    resumed = compute(config, output).records
    # Every solution was made once, but for the two that were cut short.
    assert len(solves(tmp_path)) == TARGETS + 2
    assert untimed(resumed) == untimed(compute(config, tmp_path / "whole").records)
