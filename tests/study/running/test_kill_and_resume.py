import os
import signal
import sys
from pathlib import Path

import pytest

from holobench_eval.commands import main
from holobench_eval.study.executors.processes import start
from tests.study.studies import compute, compute_faked
from tests.support.patience import PATIENCE, killed_at, wait_until
from tests.support.studies.fake_study import held, install, solves, untimed, write_config

TARGETS = 5


def command(config: Path, output: Path, said: Path) -> None:
    """``holoeval run`` with the fakes, in a process of its own, and what it says of errors in a file."""
    install()
    os.dup2(os.open(said, os.O_WRONLY | os.O_CREAT), 2)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    sys.argv = ["holoeval", "run", str(config), "--output", str(output), "--executor", "serial", "--threads", "1"]
    main()


@pytest.mark.slow
@pytest.mark.usefixtures("no_physics")
def test_a_run_that_was_killed_and_interrupted_gives_the_records_of_one_that_was_not(tmp_path):
    config, output, said = write_config(tmp_path, count=TARGETS), tmp_path / "out", tmp_path / "said.txt"
    with held(tmp_path, 1):
        killed_at(lambda: len(solves(tmp_path)) >= 2, compute_faked, config, output)
    with held(tmp_path, 3):
        stopped = start(command, config, output, said)
        wait_until(lambda: len(solves(tmp_path)) >= 5)
        os.kill(stopped.pid or 0, signal.SIGINT)
        stopped.join(PATIENCE)
    assert stopped.exitcode == 130
    assert "resume with the same command" in said.read_text()
    assert "Traceback" not in said.read_text()

    resumed = compute(config, output).records
    # Every solution was made once, but for the two that were cut short.
    assert len(solves(tmp_path)) == TARGETS + 2
    assert untimed(resumed) == untimed(compute(config, tmp_path / "whole").records)
