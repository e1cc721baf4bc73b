from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from holobench_eval.report import build_report
from holobench_eval.study.config import load_study
from tests.study.test_run import compute
from tests.support import fake_study
from tests.support.fake_study import held, solves, untimed_table, write_config
from tests.support.patience import PATIENCE

TARGETS = 5


def start(config: Path, output: Path, *options: str) -> subprocess.Popen[str]:
    command = [sys.executable, str(Path(fake_study.__file__)), "run", str(config), "--output", str(output)]
    return subprocess.Popen(
        [*command, "--executor", "serial", "--threads", "1", *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"MPLBACKEND": "agg"},
    )


def wait_for_solves(folder: Path, count: int, process: subprocess.Popen[str]) -> None:
    deadline = time.monotonic() + PATIENCE
    while len(solves(folder)) < count:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.01)


def wait_for(process: subprocess.Popen[str]) -> tuple[int, str, str]:
    out, err = process.communicate(timeout=PATIENCE)
    return process.returncode, out, err


def assert_tables_of_a_whole_run(config: Path, output: Path) -> None:
    """The tables in a folder are those of a run that nothing has stopped."""
    other = output.with_name("whole")
    whole = compute(config, other)
    build_report(load_study(config), whole.records, other, whole.provenance)
    for name in ("table.csv", "records.csv"):
        assert untimed_table(output / name) == untimed_table(other / name)


@pytest.mark.slow
@pytest.mark.usefixtures("no_physics")
def test_a_run_that_was_killed_and_interrupted_gives_the_bytes_of_one_that_was_not(tmp_path: Path) -> None:
    config = write_config(tmp_path, count=TARGETS)
    output = tmp_path / "out"

    with held(tmp_path, 1):
        killed = start(config, output)
        wait_for_solves(tmp_path, 2, killed)
        killed.kill()
        assert wait_for(killed)[0] == -signal.SIGKILL
    assert not (output / "table.csv").exists()

    with held(tmp_path, 3):
        stopped = start(config, output)
        wait_for_solves(tmp_path, 5, stopped)
        stopped.send_signal(signal.SIGINT)
        code, _, err = wait_for(stopped)
    assert code == 130
    assert "resume with the same command" in err
    assert "Traceback" not in err

    code, out, err = wait_for(start(config, output))
    assert (code, err) == (0, "")
    assert "psnr" in out.lower()
    # Every solution was made once, but for the two that were cut short.
    assert len(solves(tmp_path)) == TARGETS + 2

    assert_tables_of_a_whole_run(config, output)
