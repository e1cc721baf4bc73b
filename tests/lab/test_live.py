"""A study on devices: what ``holoeval run`` does with a bench file, on a panel and a camera that are simulated."""

from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

from holobench_eval.commands import app
from holobench_eval.core.errors import UserError
from holobench_eval.lab.devices import DeviceError
from holobench_eval.study.opening import forget_sessions
from tests.support import simulated_devices as simulated

STUDY = """\
title: On a table
display: {bench: bench.yaml}
targets: {dataset: photographs, params: {count: 1}}
methods: [double_phase, {name: wirtinger, params: {iterations: 20}}]
"""


@pytest.fixture
def table(monkeypatch, tmp_path):
    """A folder with a bench file, and its devices behind the drivers' names."""
    scene = simulated.Scene(simulated.bench())
    slm, camera = simulated.SimulatedSlm(scene), simulated.SimulatedCamera(scene)
    simulated.connect(slm, camera, monkeypatch.setattr)
    (tmp_path / "bench.yaml").write_text(simulated.BENCH)
    (tmp_path / "study.yaml").write_text(STUDY)
    (tmp_path / "switch.py").write_text("def switch(channel):\n    pass\n")
    forget_sessions()
    yield tmp_path, scene, camera
    forget_sessions()


def run(folder: Path):
    return CliRunner().invoke(app, ["run", str(folder / "study.yaml"), "--output", str(folder / "out")])


def test_a_study_runs_on_a_bench_that_was_checked_and_a_camera_that_goes_away_ends_it(table, monkeypatch):
    folder, _, camera = table
    done = run(folder)
    assert done.exit_code == 0, (done.output, done.exception)
    for line in ("exposure:", "dark:", "linearity:", "phase convention:", "phase.two_pi_level:"):
        assert line in done.output
    scores = pd.read_csv(folder / "out" / "table.csv").set_index(["label", "condition"])["psnr_linear_db"]
    assert scores["wirtinger", "small-table"] > scores["double_phase", "small-table"] + 2
    assert "real bench" in (folder / "out" / "report.md").read_text()

    def gone(seconds):
        raise DeviceError("unplugged")

    monkeypatch.setattr(camera, "expose", gone)
    records = {path: path.read_text() for path in (folder / "out" / "records").glob("*.json")}
    unmade = [path for path, text in records.items() if '"wirtinger"' in text or '"double_phase"' in text]
    for path in unmade:
        path.unlink()
    done = run(folder)
    assert isinstance(done.exception, UserError)
    assert "unplugged" in str(done.exception)
    assert all(path.read_text() == text for path, text in records.items() if path not in unmade)


def test_a_wrong_sign_is_refused_before_anything_is_computed(table):
    folder, scene, _ = table
    scene.sign = -1
    done = run(folder)
    assert isinstance(done.exception, UserError)
    assert "phase.sign" in str(done.exception)
    assert not (folder / "out").exists()


def test_frames_are_refused_for_a_driver_without_sequences(table):
    folder, _, _ = table
    (folder / "bench.yaml").write_text(simulated.BENCH.replace("bits: 8,", "bits: 8, frames: 2,"))
    done = run(folder)
    assert isinstance(done.exception, UserError)
    assert "panel.frames is 2, but driver 'simulated' shows one pattern an exposure; leave it out, " in str(
        done.exception
    )
