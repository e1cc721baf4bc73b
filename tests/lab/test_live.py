"""A study on devices: what ``holoeval run`` does with a bench file, on a panel and a camera that are simulated."""

from pathlib import Path

import pandas as pd
import pytest

from holobench_eval.study.opening import forget_sessions
from tests.lab.session.running import run
from tests.study.studies import write_study
from tests.support import simulated_devices as simulated


@pytest.fixture
def table(monkeypatch, tmp_path):
    """A folder with a bench file, and its devices behind the drivers' names."""
    scene = simulated.Scene(simulated.bench())
    slm, camera = simulated.SimulatedSlm(scene), simulated.SimulatedCamera(scene)
    simulated.connect(slm, camera, monkeypatch.setattr)
    (tmp_path / "bench.yaml").write_text(simulated.BENCH)
    wirtinger = "{name: wirtinger, params: {iterations: 20}}"
    write_study(tmp_path / "study.yaml", "double_phase", wirtinger, display="{bench: bench.yaml}")
    (tmp_path / "switch.py").write_text("def switch(channel):\n    pass\n")
    forget_sessions()
    yield tmp_path, scene, camera
    forget_sessions()


def study(folder: Path) -> tuple[str, str]:
    """What a run of the study says, and the line with which it ends."""
    return run("run", folder / "study.yaml", "--output", folder / "out")


def test_a_study_runs_on_a_bench_that_was_checked(table):
    folder, _, _ = table
    said, failure = study(folder)
    assert not failure
    for line in ("exposure:", "dark:", "linearity:", "phase convention:", "phase.two_pi_level:"):
        assert line in said
    scores = pd.read_csv(folder / "out" / "table.csv").set_index(["label", "condition"])["psnr_linear_db"]
    assert scores["wirtinger", "small-table"] > scores["double_phase", "small-table"] + 2
    assert "real bench" in (folder / "out" / "report.md").read_text()


def test_a_wrong_sign_is_refused_before_anything_is_computed(table):
    folder, scene, _ = table
    scene.sign = -1
    assert "phase.sign" in study(folder)[1]
    assert not (folder / "out").exists()


def test_frames_are_refused_for_a_driver_without_sequences(table):
    folder, _, _ = table
    (folder / "bench.yaml").write_text(simulated.BENCH.replace("bits: 8,", "bits: 8, frames: 2,"))
    assert "panel.frames is 2, but simulated panel shows one pattern an exposure" in study(folder)[1]
