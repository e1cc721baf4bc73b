"""A study through a session folder: files out, photographs in, the scores of the direct run."""

import csv
import json
import re
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest
import torch
from PIL import Image
from PIL.PngImagePlugin import PngInfo
from torch import Tensor

from holobench_eval.core.hashing import digest
from holobench_eval.display import CalibratedBench
from holobench_eval.display.api import Camera, Capture
from holobench_eval.lab.real import RealBench
from holobench_eval.lab.session import read_manifest
from holobench_eval.methods.calibrated import patterns
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.study import opening
from tests.lab.session.running import run as ended
from tests.lab.session.running import succeed as run
from tests.study.studies import write_green
from tests.support.photographing import Lab

STUDY = """\
title: A study to be photographed
seed: 3
display: {profiles: [leto-mild], panel: [144, 144]}
targets: {dataset: photographs, params: {count: 2}}
protocol: {metrics: [psnr, ssim]}
methods:
  - double_phase
  - {name: wirtinger, params: {iterations: 20}}
"""


def table(folder: Path) -> pd.DataFrame:
    return pd.read_csv(folder / "table.csv").set_index(["label", "condition"])


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("session")
    config = folder / "study.yaml"
    config.write_text(STUDY.replace("count: 2", "count: 1"))
    said = run("session", "export", config, folder / "bench")
    Lab("leto-mild", (144, 144), seed=1).photograph_round(folder / "bench", 1)
    return folder, said


@pytest.fixture(scope="module")
def exported_in_green(tmp_path_factory):
    """The session of one laser, for what is the same in every colour."""
    folder = tmp_path_factory.mktemp("green")
    profile = write_green(folder, "leto-mild")
    (folder / "study.yaml").write_text(STUDY.replace("leto-mild", profile.name))
    run("session", "export", folder / "study.yaml", folder / "bench")
    Lab(str(profile), (144, 144), seed=1).photograph_round(folder / "bench", 1)
    return folder


@pytest.fixture
def averaged(monkeypatch):
    """Captures of a direct run are scored by means over the target's pixels, as photographs are."""
    plain = CalibratedBench.photograph

    def photograph(self, phase, target, **more):
        shot = plain(self, phase, target, **more)
        return replace(shot, image=RealBench._averaged(self, shot.capture, target, self.registration))

    monkeypatch.setattr(CalibratedBench, "photograph", photograph)


def test_photographs_through_files_score_as_the_direct_run_does_and_are_read_once(exported, averaged):
    folder, said = exported
    assert "round 1" in said
    run("session", "import", folder / "bench")
    assert "0 of 7 cells to compute" in run("session", "import", folder / "bench")
    run("run", folder / "study.yaml", "--output", folder / "direct", "--executor", "serial")
    ours, direct = table(folder / "bench" / "report"), table(folder / "direct")
    for row in (("double_phase", "leto-mild"), ("wirtinger", "leto-mild")):
        for column, error in (("psnr_linear_db", 0.1), ("ssim_linear", 0.01)):
            assert ours.loc[row, column] == pytest.approx(direct.loc[row, column], abs=error)
    run("site", folder / "bench" / "report", folder / "direct", "--output", folder / "site")
    titles = re.findall(r"<h2>(leto-mild.*)</h2>", (folder / "site" / "index.html").read_text())
    assert [re.sub(r"real, \w{8}", "real", title) for title in sorted(titles)] == ["leto-mild", "leto-mild (real)"]
    one = captures(folder / "bench", "hologram")[0]
    content = one.read_bytes()
    save(one, counts(one) + 1)
    assert "has changed since its round was read" in wrong(folder / "bench")
    one.write_bytes(content)


def wrong(folder: Path, *more: object) -> str:
    """The one line with which an import ends."""
    return ended("session", "import", folder, *more)[1]


@pytest.fixture
def photographed(exported_in_green, tmp_path):
    """A copy of the session with its photographs, none of them read yet."""
    return shutil.copytree(exported_in_green, tmp_path / "copy") / "bench"


def own(folder: Path) -> tuple[object, ...]:
    """The option that gives an import the user's config, whose display is a file."""
    return "--study", folder.parent / "study.yaml"


def captures(folder: Path, role: str) -> list[Path]:
    rows = csv.DictReader((folder / "patterns" / "round-1" / "order.csv").read_text().splitlines())
    return [folder / row["save_photograph_as"] for row in rows if row["role"] == role]


def save(path: Path, counts: np.ndarray) -> None:
    assert cv2.imwrite(str(path), counts)


def counts(path: Path) -> np.ndarray:
    return cv2.imread(str(path), cv2.IMREAD_UNCHANGED)


def in_bytes(path: Path) -> None:
    save(path, (counts(path) >> 8).astype(np.uint8))


def outside(path: Path) -> None:
    shutil.move(path, path.parents[3] / "secret.png")
    path.symlink_to(path.parents[3] / "secret.png")


@pytest.mark.parametrize(
    ("role", "spoil", "line"),
    [
        ("hologram", Path.unlink, "missing: captures/round-1/{}"),
        ("hologram", lambda path: save(path, counts(path)[:-2]), "wrong size: captures/round-1/{}"),
        ("hologram", lambda path: save(path, counts(path) | 0xFFFF), "of captures/round-1/{} is at 65535 counts"),
        ("hologram", in_bytes, "another kind of file: captures/round-1/{}"),
        ("hologram", outside, "leads out of the session folder"),
        ("dark", lambda path: save(path, counts(captures(path.parents[2], "hologram")[3]) + 1), "{} should be dark"),
    ],
)
def test_a_photograph_that_cannot_be_is_named(photographed, role, spoil, line):
    path = captures(photographed, role)[0]
    spoil(path)
    assert line.format(path.stem) in wrong(photographed, *own(photographed))


def test_a_stale_frame_and_a_copy_are_told_apart_whatever_their_time_stamps(photographed):
    first, second, *_, last = captures(photographed, "hologram")
    note = PngInfo()
    note.add_text("time", "later")
    Image.open(first).save(second, pnginfo=note)
    assert f"stale frame: captures/round-1/{second.stem} is captures/round-1/{first.stem} again" in wrong(
        photographed, *own(photographed)
    )
    shutil.copyfile(first, last)
    assert f"duplicated: captures/round-1/{last.stem}" in wrong(photographed, *own(photographed))


def test_photographs_in_the_wrong_order_are_found_and_can_be_put_right(photographed):
    holograms = captures(photographed, "hologram")
    for paths in ([captures(photographed, "fiducial")[0], holograms[0]], holograms):
        contents = [path.read_bytes() for path in paths]
        for path, content in zip(paths, contents[1:] + contents[:1], strict=True):
            path.write_bytes(content)
        assert "wrong order: captures/round-1/" in wrong(photographed, *own(photographed))
        for path, content in zip(paths, contents, strict=True):
            path.write_bytes(content)
    assert "table.csv" in run("session", "import", photographed, *own(photographed))


def test_bits_at_the_upper_end_are_told_and_dark_frames_without_any_count_are_dark(photographed):
    for path in (photographed / "captures" / "round-1").glob("*.png"):
        save(path, np.maximum(counts(path).astype(np.int64) - 1000, 0).astype(np.uint16) & 0xFFF0)
    for path in captures(photographed, "dark"):
        save(path, np.zeros_like(counts(path)))
    said = run("session", "import", photographed, *own(photographed))
    assert "12 bits at the upper end of 16" in said
    assert "12 bits at the upper end of 16" in (photographed / "report" / "report.md").read_text()


def test_jpeg_is_flagged_as_not_linear(photographed):
    for path in (photographed / "captures" / "round-1").glob("*.png"):
        light = counts(path) / 65535
        encoded = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
        cv2.imwrite(str(path.with_suffix(".jpg")), (encoded * 255).round().astype(np.uint8), [1, 100])
        path.unlink()
    assert "not linear in light" in run("session", "import", photographed, *own(photographed))


def test_a_folder_in_use_is_not_exported_into(exported):
    folder, _ = exported
    assert "not empty" in ended("session", "export", folder / "study.yaml", folder / "bench")[1]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("methods:", "sweeps: [{condition: defocus, values: [1.0]}]\nmethods:"), "changes of a display"),
        (("methods:\n  - double_phase\n", "methods:\n  - oracle\n"), ""),
        (("[leto-mild]", "[leto-mild, ideal]"), "choose one with --display"),
        (("[leto-mild]", "[plm-4bit]"), "4 bits; patterns are written with 8"),
    ],
)
def test_what_cannot_be_photographed_is_refused_or_left_out(tmp_path, change, said):
    config = tmp_path / "study.yaml"
    config.write_text(STUDY.replace(*change).replace("count: 2", "count: 1"))
    failure = ended("session", "export", config, tmp_path / "bench")[1]
    assert said in failure if said else "oracle" not in (tmp_path / "bench" / "manifest.json").read_text()


def test_a_folder_from_elsewhere_runs_no_code_and_reads_no_folder_of_its_own_accord(photographed):
    manifest = json.loads((photographed / "manifest.json").read_text())
    for line in ("  - /tmp/evil.py:Method\n", "  - evil.py:Method\n"):
        (photographed / "study.yaml").write_text(STUDY + line)
        (photographed / "manifest.json").write_text(json.dumps(manifest | {"study_sha256": digest(STUDY + line)}))
        assert "give --study with your own copy" in wrong(photographed)


def test_another_study_than_the_exported_one_is_refused(photographed, tmp_path):
    other = tmp_path / "other.yaml"
    other.write_text(STUDY.replace("seed: 3", "seed: 4"))
    assert "is not the config that this session was exported from" in wrong(photographed, "--study", other)


ROUNDS = """\
title: A study in rounds
seed: 3
display: {profiles: [green.yaml], panel: [128, 128]}
targets: {dataset: photographs, params: {count: 1}}
training: {dataset: dead_leaves, params: {count: 3}, held_out: 1}
protocol: {metrics: [psnr]}
methods:
  - {name: wirtinger, params: {iterations: 10}}
  - {name: online_camera, params: {captures: 4, start: {offsets: 1, converged: {iterations: 10}}, checks: 1}}
  - name: parametric_model
    params: {patterns: 2, search: {iterations: 4}, retrieval: {iterations: 8}, training: {rounds: 2, images: 2,
      refine_images: 1, steps: 200, refine_steps: 100}}
"""
METHODS = [(method, "green") for method in ("wirtinger", "online_camera", "parametric_model")]


@dataclass
class BothCameras:
    """Takes a capture directly, and gives the photograph that a session has of the same phase.

    alike: of each pair in the target's frame, how they correlate, and how much brighter the photograph is.
    """

    direct: Camera
    session: Camera
    rectified: Callable[[Capture, bool], Tensor]
    alike: list[tuple[float, float]]

    def announce(self, phases: Sequence[Tensor]) -> None:
        """A direct run needs no notice."""

    def capture(self, phase: Tensor) -> Capture:
        photograph = self.session.capture(phase)
        pair = self.rectified(self.direct.capture(phase), False), self.rectified(photograph, True)
        correlation = torch.corrcoef(torch.stack([image.flatten() for image in pair]))[0, 1]
        self.alike.append((float(correlation), float(pair[1].mean() / pair[0].mean())))
        return photograph


def photographed_by(real: RealBench, put: Callable[[object, str, object], None]) -> list[tuple[float, float]]:
    """Let direct runs learn from the photographs of a session; how these are alike what the runs would have taken."""
    session, rectified, alike = CalibratedBench.session, CalibratedBench.rectified, list[tuple[float, float]]()

    def both(bench: CalibratedBench, names: tuple[object, ...], target: Tensor) -> BothCameras:
        def seen(capture: Capture, is_photograph: bool) -> Tensor:
            return real.rectified(capture, target) if is_photograph else rectified(bench, capture, target)

        return BothCameras(session(bench, names, target), real.session(names, target), seen, alike)

    put(CalibratedBench, "session", both)
    put(CalibratedBench, "rectified", lambda _, *given: real.rectified(*given))
    put(CalibratedBench, "photograph", lambda _, *given, **named: real.photograph(*given, **named))
    return alike


def test_learning_and_watching_methods_go_round_by_round_to_the_direct_scores(tmp_path, monkeypatch):
    monkeypatch.setattr(patterns, "Wirtinger", partial(Wirtinger, iterations=5))
    config, folder, profile = tmp_path / "study.yaml", tmp_path / "bench", write_green(tmp_path, "leto-aged")
    config.write_text(ROUNDS)
    run("session", "export", config, folder)
    lab = Lab(str(profile), (128, 128), seed=2)
    for number in range(1, 12):
        lab.photograph_round(folder, number)
        run("session", "import", folder, "--study", config)
        if read_manifest(folder).rounds == number:
            break
    assert 3 <= number <= 9
    (real,) = (bench for bench in opening._open.values() if isinstance(bench, RealBench))
    alike = photographed_by(real, monkeypatch.setattr)
    run("run", config, "--output", tmp_path / "direct", "--executor", "serial", "--artifacts", tmp_path / "artifacts")
    ours, direct = table(folder / "report"), table(tmp_path / "direct")
    columns = ["psnr_linear_db", "captures", "training_captures"]
    # From the same photographs all is learned to the last digit.
    assert ours.loc[METHODS, columns].equals(direct.loc[METHODS, columns])
    plain, camera, model = ours.loc[METHODS, "psnr_linear_db"]
    assert camera > plain + 0.4
    assert model > plain + 2
    correlations, brightnesses = zip(*alike, strict=True)
    assert len(alike) == ours.loc[METHODS, columns[1:]].sum().sum()
    assert min(correlations) > 0.95  # by cameras that stand elsewhere
    assert max(brightnesses) < 1.3 * min(brightnesses)


def test_an_export_that_was_interrupted_goes_on_with_import(tmp_path):
    config, folder = tmp_path / "study.yaml", tmp_path / "bench"
    config.write_bytes(STUDY.replace("count: 2", "count: 1").replace("\n", "\r\n").encode())
    run("session", "export", config, folder)
    manifest = json.loads((folder / "manifest.json").read_text())
    (folder / "manifest.json").write_text(json.dumps({**manifest, "patterns": []}))
    assert "round 1:" in run("session", "import", folder)


def test_a_method_cannot_go_on_without_its_photograph(tmp_path):
    (tmp_path / "stubborn.py").write_text(
        "import torch\nfrom contextlib import suppress\n\n\ndef stubborn(target, bench):\n"
        "    phase = torch.zeros(1, 3, *bench.spec.shape)\n    with suppress(Exception):\n"
        "        bench.capture(phase[0])\n    return phase\n\n\nstubborn.camera = True\n"
    )
    config = tmp_path / "study.yaml"
    config.write_text(STUDY.replace("  - double_phase\n", "  - stubborn.py:stubborn\n").replace("count: 2", "count: 1"))
    said = run("session", "export", config, tmp_path / "bench")
    assert "round 1:" in said
    assert len(list((tmp_path / "bench" / "report" / "solved").glob("*.pt"))) == 2  # wirtinger's, and its descent
