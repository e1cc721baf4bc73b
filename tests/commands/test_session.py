"""A study through a session folder: files out, photographs in, the scores of the direct run."""

import csv
import io
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest
from PIL import Image
from PIL.PngImagePlugin import PngInfo
from typer.testing import CliRunner

from holobench_eval.commands import app
from holobench_eval.core.errors import UserError
from holobench_eval.core.hashing import digest
from holobench_eval.display import CalibratedBench
from holobench_eval.lab.real import RealBench
from holobench_eval.lab.session import read_manifest
from tests.support.photographing import Lab

STUDY = """\
title: A study to be photographed
seed: 3
display: {profiles: [leto-mild], panel: [144, 144]}
targets: {dataset: photographs, params: {count: 2}}
methods:
  - double_phase
  - {name: wirtinger, params: {iterations: 20}}
"""


def run(*arguments: object) -> str:
    done = CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.output


def table(folder: Path) -> pd.DataFrame:
    return pd.read_csv(folder / "table.csv").set_index(["label", "condition"])


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("session")
    config = folder / "study.yaml"
    config.write_text(STUDY)
    said = run("session", "export", config, folder / "bench")
    Lab("leto-mild", (144, 144), seed=1).photograph_round(folder / "bench", 1)
    return folder, said


@pytest.fixture
def averaged(monkeypatch):
    """Captures of a direct run are scored by means over the target's pixels, as photographs are."""
    plain = CalibratedBench.photograph

    def photograph(self, phase, target, **more):
        shot = plain(self, phase, target, **more)
        return replace(shot, image=RealBench._averaged(self, shot.capture, target, self.registration))

    monkeypatch.setattr(CalibratedBench, "photograph", photograph)


def test_photographs_through_files_score_as_the_direct_run_does(exported, averaged):
    folder, said = exported
    assert "round 1" in said
    run("session", "import", folder / "bench")
    run("run", folder / "study.yaml", "--output", folder / "direct", "--executor", "serial")
    ours, direct = table(folder / "bench" / "report"), table(folder / "direct")
    for method in ("double_phase", "wirtinger"):
        row = (method, "leto-mild")
        assert ours.loc[row, "psnr_linear_db"] == pytest.approx(direct.loc[row, "psnr_linear_db"], abs=0.1)
        assert ours.loc[row, "ssim_linear"] == pytest.approx(direct.loc[row, "ssim_linear"], abs=0.01)
    run("site", folder / "bench" / "report", folder / "direct", "--output", folder / "site", "--own", folder)
    titles = {
        name: re.findall(r"<h2>(leto-mild.*)</h2>", (folder / "site" / "studies" / f"{name}.html").read_text())
        for name in ("report", "direct")
    }
    assert re.fullmatch(r"leto-mild [(]real, \w{8}[)]", titles["report"][0])
    assert titles["direct"] == ["leto-mild"]


def wrong(folder: Path, *more: object) -> str:
    """The one line with which an import ends."""
    done = CliRunner().invoke(app, ["session", "import", str(folder), *map(str, more)])
    assert isinstance(done.exception, UserError), (done.output, done.exception)
    line = str(done.exception)
    assert "\n" not in line
    return line


@pytest.fixture
def photographed(exported, tmp_path):
    """A copy of the session with its photographs, none of them read yet."""
    shutil.copytree(exported[0] / "bench", tmp_path / "bench", ignore=shutil.ignore_patterns("report"))
    manifest = json.loads((tmp_path / "bench" / "manifest.json").read_text())
    manifest["photographed"] = None
    (tmp_path / "bench" / "manifest.json").write_text(json.dumps(manifest))
    return tmp_path / "bench"


def captures(folder: Path, role: str) -> list[Path]:
    rows = csv.DictReader((folder / "patterns" / "round-1" / "order.csv").read_text().splitlines())
    return [folder / row["save_photograph_as"] for row in rows if row["role"] == role]


def save(path: Path, counts: np.ndarray) -> None:
    assert cv2.imwrite(str(path), counts)


def test_a_missing_photograph_is_named(photographed):
    lost = captures(photographed, "hologram")[1]
    lost.unlink()
    assert f"missing: captures/round-1/{lost.stem}" in wrong(photographed)


def test_photographs_of_another_size_are_named(photographed):
    odd = captures(photographed, "hologram")[0]
    save(odd, cv2.imread(str(odd), -1)[:-2])
    assert f"wrong size: captures/round-1/{odd.stem}" in wrong(photographed)


def test_a_saturated_photograph_is_refused(photographed):
    bright = captures(photographed, "hologram")[0]
    counts = cv2.imread(str(bright), -1)
    counts[:9] = 65535
    save(bright, counts)
    assert f"of captures/round-1/{bright.stem} is at 65535 counts" in wrong(photographed)


def test_a_stale_frame_and_a_copy_are_told_apart(photographed):
    first, second, *_, last = captures(photographed, "hologram")
    shutil.copyfile(first, second)
    assert f"stale frame: captures/round-1/{second.stem} is captures/round-1/{first.stem} again" in wrong(photographed)
    shutil.copyfile(first, last)
    assert f"duplicated: captures/round-1/{last.stem}" in wrong(photographed)


def test_photographs_of_two_pictures_that_changed_places_are_found(photographed):
    manifest = json.loads((photographed / "manifest.json").read_text())
    shown = [one for one in manifest["patterns"] if one["role"] == "hologram" and one["colour"] == 0]
    paths = [photographed / f"{one['capture']}.png" for one in shown]
    contents = [path.read_bytes() for path in paths]
    for path, content in zip(paths, contents[1:] + contents[:1], strict=True):
        path.write_bytes(content)
    assert "wrong order: captures/round-1/" in wrong(photographed)


def test_a_dark_frame_with_the_laser_on_is_found(photographed):
    dark, bright = captures(photographed, "dark")[0], captures(photographed, "hologram")[3]
    save(dark, cv2.imread(str(bright), -1) + 1)
    assert f"captures/round-1/{dark.stem} should be dark" in wrong(photographed)


def test_a_link_out_of_the_folder_is_not_read(photographed, tmp_path):
    one = captures(photographed, "hologram")[0]
    shutil.move(one, tmp_path / "secret.png")
    one.symlink_to(tmp_path / "secret.png")
    assert "leads out of the session folder" in wrong(photographed)


def test_bits_at_the_upper_end_and_lossy_files_are_told(photographed):
    for path in (photographed / "captures" / "round-1").glob("*.png"):
        save(path, cv2.imread(str(path), -1) & 0xFFF0)
    said = run("session", "import", photographed)
    assert "12 bits at the upper end of 16" in said
    assert "12 bits at the upper end of 16" in (photographed / "report" / "report.md").read_text()


def test_jpeg_is_flagged_as_not_linear(photographed):
    for path in (photographed / "captures" / "round-1").glob("*.png"):
        light = cv2.imread(str(path), -1) / 65535
        encoded = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
        cv2.imwrite(str(path.with_suffix(".jpg")), (encoded * 255).round().astype(np.uint8), [1, 100])
        path.unlink()
    said = run("session", "import", photographed)
    assert "not linear in light" in said


def test_a_photograph_that_changes_after_it_was_read_is_refused_and_reading_again_computes_nothing(photographed):
    run("session", "import", photographed)
    assert "0 of 16 cells to compute" in run("session", "import", photographed)
    one = captures(photographed, "hologram")[0]
    save(one, cv2.imread(str(one), -1) + 1)
    assert "has changed since its round was read" in wrong(photographed)


def test_a_folder_in_use_is_not_exported_into(exported):
    folder, _ = exported
    done = CliRunner().invoke(app, ["session", "export", str(folder / "study.yaml"), str(folder / "bench")])
    assert "not empty" in str(done.exception)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("methods:", "sweeps: [{condition: defocus, values: [1.0]}]\nmethods:"), "changes of a display"),
        (("methods:\n  - double_phase\n", "methods:\n  - oracle\n"), ""),
        (("[leto-mild]", "[leto-mild, ideal]"), "choose one with --display"),
        (("[leto-mild]", "[plm-4bit]"), "4 bits"),
    ],
)
def test_what_cannot_be_photographed_is_refused_or_left_out(tmp_path, change, said):
    config = tmp_path / "study.yaml"
    config.write_text(STUDY.replace(*change).replace("count: 2", "count: 1"))
    done = CliRunner().invoke(app, ["session", "export", str(config), str(tmp_path / "bench")])
    if said:
        assert said in str(done.exception)
        return
    assert done.exit_code == 0
    assert "oracle" not in (tmp_path / "bench" / "manifest.json").read_text()


def test_a_folder_from_elsewhere_runs_no_code_and_reads_no_folder_of_its_own_accord(photographed):
    for line in ("  - /tmp/evil.py:Method\n", "  - evil.py:Method\n"):
        text = STUDY + line
        (photographed / "study.yaml").write_text(text)
        manifest = json.loads((photographed / "manifest.json").read_text())
        manifest["study_sha256"] = digest(text)
        (photographed / "manifest.json").write_text(json.dumps(manifest))
        assert "give --study with your own copy" in wrong(photographed)


def test_another_study_than_the_exported_one_is_refused(photographed, tmp_path):
    other = tmp_path / "other.yaml"
    other.write_text(STUDY.replace("seed: 3", "seed: 4"))
    assert "is not the config that this session was exported from" in wrong(photographed, "--study", other)


ROUNDS = """\
title: A study in rounds
seed: 3
display: {profiles: [leto-aged], panel: [128, 128]}
targets: {dataset: photographs, params: {count: 1}}
training: {dataset: dead_leaves, params: {count: 3}, held_out: 1}
methods:
  - {name: online_camera, params: {captures: 4, start: {offsets: 1, converged: {iterations: 10}}, checks: 1}}
  - name: parametric_model
    params:
      patterns: 2
      training: {rounds: 2, images: 2, refine_images: 1, steps: 200, refine_steps: 100}
      search: {iterations: 4}
      retrieval: {iterations: 8}
"""


def test_methods_that_learn_and_methods_with_a_camera_go_round_by_round_to_the_direct_scores(tmp_path, averaged):
    config, folder = tmp_path / "study.yaml", tmp_path / "bench"
    config.write_text(ROUNDS)
    run("session", "export", config, folder)
    lab = Lab("leto-aged", (128, 128), seed=2)
    for number in range(1, 12):
        lab.photograph_round(folder, number)
        run("session", "import", folder)
        if read_manifest(folder).rounds == number:
            break
    assert 3 <= number <= 9
    run("run", config, "--output", tmp_path / "direct", "--executor", "serial", "--artifacts", tmp_path / "artifacts")
    ours, direct = table(folder / "report"), table(tmp_path / "direct")
    for method in ("online_camera", "parametric_model"):
        row = (method, "leto-aged")
        assert ours.loc[row, "psnr_linear_db"] == pytest.approx(direct.loc[row, "psnr_linear_db"], abs=0.3)
        assert ours.loc[row, "captures"] == direct.loc[row, "captures"]
        assert ours.loc[row, "training_captures"] == direct.loc[row, "training_captures"]


def test_photographs_in_the_wrong_order_can_be_put_right(photographed):
    first, second = captures(photographed, "fiducial")[0], captures(photographed, "hologram")[0]
    contents = first.read_bytes(), second.read_bytes()
    for path, content in zip((first, second), reversed(contents), strict=True):
        path.write_bytes(content)
    assert "wrong order" in wrong(photographed)
    for path, content in zip((first, second), contents, strict=True):
        path.write_bytes(content)
    assert "table.csv" in run("session", "import", photographed)


def test_photographs_of_several_kinds_are_refused(photographed):
    odd = captures(photographed, "hologram")[0]
    save(odd, (cv2.imread(str(odd), -1) >> 8).astype(np.uint8))
    assert f"another kind of file: captures/round-1/{odd.stem}" in wrong(photographed)


def test_dark_frames_without_any_count_are_dark(photographed):
    for path in (photographed / "captures" / "round-1").glob("*.png"):
        counts = cv2.imread(str(path), -1).astype(np.int64) - 1000
        save(path, np.maximum(counts, 0).astype(np.uint16))
    for path in captures(photographed, "dark"):
        save(path, np.zeros_like(cv2.imread(str(path), -1)))
    assert "table.csv" in run("session", "import", photographed)


def test_a_copy_of_a_frame_with_another_time_stamp_is_still_a_copy(photographed):
    first, second, *_ = captures(photographed, "hologram")
    content = first.read_bytes()
    note = PngInfo()
    note.add_text("time", "later")
    Image.open(io.BytesIO(content)).save(second, pnginfo=note)
    assert "stale frame" in wrong(photographed)


def test_an_export_that_was_interrupted_goes_on_with_import(tmp_path):
    config, folder = tmp_path / "study.yaml", tmp_path / "bench"
    config.write_bytes(STUDY.replace("count: 2", "count: 1").replace("\n", "\r\n").encode())
    run("session", "export", config, folder)
    manifest = json.loads((folder / "manifest.json").read_text())
    (folder / "manifest.json").write_text(json.dumps({**manifest, "patterns": []}))
    assert "round 1:" in run("session", "import", folder)


def test_a_bench_beside_the_study_travels_with_the_session(tmp_path):
    (tmp_path / "ours.yaml").write_text(
        "name: ours\nversion: 1\npanel: {shape: [128, 128], pitch: 6.4e-6, wavelengths: [5.2e-7], distance: 0.012, "
        "bits: 8}\nlaser: {callable: 'evil.py:run'}\nslm: {driver: monitor, name: x, resolution: [128, 128]}\n"
    )
    (tmp_path / "study.yaml").write_text(
        STUDY.replace("{profiles: [leto-mild], panel: [144, 144]}", "{bench: ours.yaml}").replace(
            "count: 2", "count: 1"
        )
    )
    run("session", "export", tmp_path / "study.yaml", tmp_path / "bench")
    assert "none of the" in wrong(tmp_path / "bench")


def test_a_method_cannot_go_on_without_its_photograph(tmp_path):
    (tmp_path / "stubborn.py").write_text(
        "from dataclasses import dataclass\nimport torch\n\n\n@dataclass(frozen=True)\nclass Stubborn:\n"
        "    camera = True\n\n    def solve(self, target, bench):\n"
        "        phase = torch.zeros(1, 3, *bench.spec.shape)\n"
        "        try:\n            bench.capture(phase[0])\n        except Exception:\n            pass\n"
        "        return phase\n"
    )
    config = tmp_path / "study.yaml"
    config.write_text(STUDY.replace("  - double_phase\n", "  - stubborn.py:Stubborn\n").replace("count: 2", "count: 1"))
    said = run("session", "export", config, tmp_path / "bench")
    assert "round 1:" in said
    assert len(list((tmp_path / "bench" / "report" / "solved").glob("*.pt"))) == 2  # wirtinger's, and its descent
