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
from holobench_eval.study.executors import Serial
from holobench_eval.study.plan import plan
from holobench_eval.study.progress import Lines
from holobench_eval.study.run import run
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

    study = load_study(config)
    grid = plan(study)
    watch, artifacts = Lines(lambda line: None), tmp_path / "artifacts"
    whole = run(study, grid, tmp_path / "whole", Serial(), watch, threads=1, artifacts=artifacts)
    build_report(study, whole.records, tmp_path / "whole", whole.provenance)
    for name in ("table.csv", "records.csv"):
        assert untimed_table(output / name) == untimed_table(tmp_path / "whole" / name)
