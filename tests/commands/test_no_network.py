"""Nothing is asked of a network at run time: a study runs where there is none."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.study.studies import write_green

CONFIG = """title: no network
display: {profiles: [green.yaml], panel: [128, 160]}
targets: {dataset: photographs, params: {count: 1}}
training: {dataset: dead_leaves, params: {count: 3}, held_out: 1}
methods:
  - {name: wirtinger, params: {iterations: 2}}
  - name: parametric_model
    params: {patterns: 2, training: {rounds: 1, images: 2, steps: 2}, retrieval: {iterations: 3}}
"""
ALONE = ["unshare", "--net", "--map-root-user"]  # in a namespace of its own, where not even the loopback is up


def _can_be_alone() -> bool:
    return shutil.which("unshare") is not None and subprocess.run([*ALONE, "true"], check=False).returncode == 0


@pytest.mark.skipif(not _can_be_alone(), reason="the system gives no namespace of the network")
def test_a_study_is_run_and_reported_without_a_network(tmp_path):
    (tmp_path / "study.yaml").write_text(CONFIG)
    write_green(tmp_path, "leto-mild")
    command = [str(Path(sys.executable).with_name("holoeval")), "run", "study.yaml", "--workers", "2"]
    done = subprocess.run([*ALONE, *command], cwd=tmp_path, capture_output=True, text=True, env=dict(os.environ))
    assert done.returncode == 0, done.stderr[-2000:]
    assert (tmp_path / "holoeval-results/study/report.html").is_file()
