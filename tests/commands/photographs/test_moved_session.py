"""A session folder is exported in one place and imported in another, with nothing left where it came from."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from holobench_eval.lab.session import read_manifest
from tests.lab.session.running import run, succeed
from tests.study.studies import write_green
from tests.support.photographing import Lab

# leto-mild on this panel, by one of its lasers
BENCH = """\
name: ours
version: 1
panel: {shape: [128, 128], pitch: 6.4e-6, wavelengths: [5.17e-7], distance: 0.0118518518, bits: 8, \
pupil: 0.8, region: 0.8}
laser: {callable: 'evil.py:run'}
slm: {driver: monitor, name: x, resolution: [128, 128]}
"""
STUDY = """\
title: Moved
display: {bench: benches/ours.yaml}
targets: {dataset: photographs, params: {count: 1}}
methods: [double_phase]
protocol: {metrics: [psnr]}
"""
OWN = STUDY.replace("photographs, params: {count: 1}", "folder, params: {path: images}").replace(
    "double_phase", "own.py:elsewhere"
)
METHOD = """\
import torch

def elsewhere(target, bench):
    torch.seed()  # as on another machine: no two solutions are the same
    return 6.2831 * torch.rand(*target.shape[:2], *bench.spec.shape)
"""


def lay_out(folder: Path, study: str) -> None:
    (folder / "benches").mkdir(parents=True)
    (folder / "images").mkdir()
    (folder / "benches" / "ours.yaml").write_text(BENCH)
    (folder / "study.yaml").write_text(study)
    (folder / "own.py").write_text(METHOD)
    draw = np.random.default_rng(0)
    smooth = cv2.resize(draw.uniform(0, 255, (6, 6, 3)).astype(np.uint8), (160, 160), interpolation=cv2.INTER_CUBIC)
    assert cv2.imwrite(str(folder / "images" / "one.png"), smooth)


def moved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, study: str) -> Path:
    """The folder of a photographed session in its new place; the old one is gone."""
    old, new = tmp_path / "old", tmp_path / "new" / "place"
    lay_out(old, study)
    monkeypatch.chdir(old)
    succeed("session", "export", "study.yaml", "session")
    Lab(str(write_green(old, "leto-mild")), (128, 128), seed=6).photograph_round(old / "session", 1)
    new.mkdir(parents=True)
    monkeypatch.chdir(new)
    shutil.move(old / "session", new / "session")
    shutil.rmtree(old)
    return new / "session"


def test_a_session_with_its_bench_file_imports_anywhere(tmp_path, monkeypatch):
    session = moved(tmp_path, monkeypatch, STUDY)
    assert "table.csv" in succeed("session", "import", session)


def test_a_session_of_own_code_needs_its_study_and_has_the_holograms_of_the_export(tmp_path, monkeypatch):
    session = moved(tmp_path, monkeypatch, OWN)
    _, failure = run("session", "import", session)
    for missing in ("path: images", "own.py:elsewhere", "dataset: folder", "give --study"):
        assert missing in failure
    assert "benches" not in failure

    lay_out(tmp_path / "mine", OWN)
    monkeypatch.chdir(tmp_path / "mine")
    without = shutil.copytree(session, tmp_path / "without")
    shutil.rmtree(without / "report")
    _, failure = run("session", "import", without, "--study", "study.yaml")
    assert "report/solved lacks those" in failure
    assert read_manifest(without).rounds == 1  # no new photographs are asked for

    monkeypatch.setattr("holobench_eval.study.identity.HARNESS", "another version")
    assert "table.csv" in succeed("session", "import", session, "--study", "study.yaml")
    assert read_manifest(session).rounds == 1
