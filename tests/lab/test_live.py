"""A study on devices: what ``holoeval run`` does with a bench file, on a panel and a camera that are simulated."""

from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

from holobench_eval.commands import app
from holobench_eval.core.errors import UserError
from holobench_eval.lab.devices import DeviceError
from holobench_eval.lab.drivers import catalogue as drivers
from holobench_eval.study.opening import forget_sessions
from tests.support import simulated_devices as simulated

BENCH = """\
name: small-table
version: 1
panel: {shape: [128, 128], pitch: 6.4e-6, wavelengths: [6.36e-7, 5.17e-7, 4.46e-7], distance: 0.0118518518, bits: 8, \
pupil: 0.8, region: 0.8}
slm: {driver: simulated}
camera: {driver: simulated}
capture: {average: 1, dark: 1, settle: 0.0}
laser: {callable: "switch.py:switch"}
"""
STUDY = """\
title: On a table
display: {bench: bench.yaml}
targets: {dataset: photographs, params: {count: 1}}
methods: [double_phase, {name: wirtinger, params: {iterations: 20}}]
"""


@dataclass(frozen=True)
class Nothing:
    """No settings."""


@pytest.fixture
def table(monkeypatch, tmp_path):
    """A folder with a bench file, and its devices behind the drivers' names."""
    scene = simulated.Scene(simulated.bench())
    slm, camera = simulated.SimulatedSlm(scene), simulated.SimulatedCamera(scene)
    for name, device in (("SLM_DRIVERS", slm), ("CAMERA_DRIVERS", camera)):
        known = next(iter(getattr(drivers, name).values()))
        driver = replace(known, settings=Nothing, opens=lambda _, device=device: device)
        monkeypatch.setattr(drivers, name, {"simulated": driver})
    monkeypatch.setattr(simulated.SimulatedCamera, "close", lambda self: None, raising=False)
    (tmp_path / "bench.yaml").write_text(BENCH)
    (tmp_path / "study.yaml").write_text(STUDY)
    (tmp_path / "switch.py").write_text("def switch(channel):\n    pass\n")
    monkeypatch.setattr("holobench_eval.lab.laser.SwitchedLaser.select", lambda _, channel: scene.select(channel))
    forget_sessions()
    yield tmp_path, scene, camera
    forget_sessions()


def run(folder: Path, *more: str):
    return CliRunner().invoke(app, ["run", str(folder / "study.yaml"), "--output", str(folder / "out"), *more])


def test_a_study_runs_on_devices_after_the_bench_was_checked(table):
    folder, _, _ = table
    done = run(folder)
    assert done.exit_code == 0, (done.output, done.exception)
    for line in ("exposure:", "dark:", "linearity:", "phase convention:", "phase.two_pi_level:"):
        assert line in done.output
    scores = pd.read_csv(folder / "out" / "table.csv").set_index(["label", "condition"])["psnr_linear_db"]
    assert scores["wirtinger", "small-table"] > scores["double_phase", "small-table"] + 2
    assert "real bench" in (folder / "out" / "report.md").read_text()


def test_a_wrong_sign_is_refused_before_anything_is_computed(table):
    folder, scene, _ = table
    scene.sign = -1
    done = run(folder)
    assert isinstance(done.exception, UserError)
    assert "phase.sign" in str(done.exception)
    assert not (folder / "out").exists()


def test_a_camera_that_goes_away_ends_the_run_and_keeps_what_is_done(table, monkeypatch):
    folder, _, camera = table
    assert run(folder).exit_code == 0
    for record in (folder / "out" / "records").glob("*.json"):
        if '"wirtinger"' in record.read_text() or '"double_phase"' in record.read_text():
            record.unlink()

    def gone(seconds):
        raise DeviceError("unplugged")

    monkeypatch.setattr(camera, "expose", gone)
    done = run(folder)
    assert isinstance(done.exception, UserError)
    assert "unplugged" in str(done.exception)
