"""A session whose dark counts are given takes no dark frames, and takes those counts off."""

import csv
from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image
from typer.testing import CliRunner

import holobench_eval.display.simulated.profile as profiles
from holobench_eval.commands import app
from holobench_eval.core.errors import UserError
from holobench_eval.lab.session.folder import FolderPhotographer
from holobench_eval.lab.session.manifest import CHECKS
from tests.lab.session.test_bench_checks import LAB, STUDY
from tests.support.photographing import Lab

PROFILE = Path(profiles.__file__).parent / "profiles" / "leto-mild.yaml"
DARK = 900  # of the lab


@pytest.mark.parametrize("kind", ["level", "file", "file of the bench"])
def test_given_dark_counts_stand_for_dark_frames(tmp_path: Path, kind: str) -> None:
    (tmp_path / "study.yaml").write_text(STUDY)
    lab, folder, given = Lab(*LAB, dark=DARK), tmp_path / "bench", str(DARK)
    if kind != "level":
        given = str(tmp_path / "my dark.npy")
        np.save(given, np.full(lab.bench.response.shape[-2:], DARK, np.float32))
    export = ["session", "export", str(tmp_path / "study.yaml"), str(folder), "--dark", given]
    if kind == "file of the bench":
        panel = yaml.safe_load(PROFILE.read_text())["panel"] | {"shape": [144, 144]}
        capture = {"dark_frames": 0, "dark": "my dark.npy"}
        described = {"name": "leto-mild", "version": 1, "panel": panel, "capture": capture}
        (tmp_path / "bench.yaml").write_text(yaml.safe_dump(described))
        export[-2:] = ["--bench", str(tmp_path / "bench.yaml")]
    done = CliRunner().invoke(app, export)
    assert done.exit_code == 0, (done.output, done.exception)
    for name in ("round-1", "checks"):
        rows = list(csv.DictReader((folder / "patterns" / name / "order.csv").read_text().splitlines()))
        assert {row["laser"] for row in rows} == {"on"}
    lab.photograph_round(folder, 1)
    if kind != "file of the bench":  # whose optics are not those of the small lab
        done = CliRunner().invoke(app, ["session", "import", str(folder)])
        assert done.exit_code == 0, (done.output, done.exception)
    photographer = FolderPhotographer(folder)
    pattern = photographer.manifest.of_round(1)[0]
    light, counts = photographer.light(pattern), photographer.counts(pattern)
    assert np.allclose(light * pattern.exposure, counts - DARK, atol=1e-2)
    if kind != "level":
        (copy,) = folder.glob("dark-*.npy")
        np.save(copy, np.zeros(counts.shape, np.float32))
        with pytest.raises(UserError, match="has changed since the session was exported"):
            FolderPhotographer(folder).light(pattern)


def described(folder: Path, **bench: object) -> list[str]:
    """The words of an export with a bench file."""
    (folder / "study.yaml").write_text(STUDY)
    panel = yaml.safe_load(PROFILE.read_text())["panel"] | {"shape": [144, 144]}
    (folder / "dark.yaml").write_text(yaml.safe_dump({"name": "lab", "version": 1, "panel": panel, **bench}))
    return ["session", "export", str(folder / "study.yaml"), str(folder / "out"), "--bench", str(folder / "dark.yaml")]


def test_given_dark_counts_go_before_those_of_the_bench_file_whatever_the_files_are_called(tmp_path: Path) -> None:
    for name, level in (("dark.npy", 64), ("new/dark.npy", 80)):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        np.save(tmp_path / name, np.full((100, 100), level, np.uint16))
    words = described(tmp_path, capture={"dark_frames": 0, "dark": "dark.npy"})
    done = CliRunner().invoke(app, [*words, "--dark", str(tmp_path / "new" / "dark.npy")])
    assert done.exit_code == 0, (done.output, done.exception)
    assert FolderPhotographer(tmp_path / "out").dark_of(1, 0).bias.mean() == 80


@pytest.mark.parametrize(
    ("ending", "dark", "line"),
    [
        (".png", np.uint8(20), "has 8 bits and the photograph 16"),
        (".png", np.float32(0.08), "never exceeds 1 and the photograph counts to 65535"),
        (".jpg", np.uint8(20), "compressed with loss, no counts to take dark ones off"),
    ],
)
def test_photographs_on_another_scale_than_the_given_dark_counts_are_a_fault(
    tmp_path: Path, ending: str, dark: np.generic, line: str
) -> None:
    np.save(tmp_path / "dark.npy", np.full((100, 100), dark))
    done = CliRunner().invoke(app, [*described(tmp_path), "--dark", str(tmp_path / "dark.npy")])
    assert done.exit_code == 0, (done.output, done.exception)
    photographer, draw = FolderPhotographer(tmp_path / "out"), np.random.default_rng(0)
    for pattern in photographer.manifest.of_round(CHECKS):
        counts = draw.integers(0, 250, (100, 100)).astype(np.uint16) * (1 if ending == ".jpg" else 256)
        picture = Image.fromarray(counts.astype(np.uint8) if ending == ".jpg" else counts)
        picture.save(tmp_path / "out" / f"{pattern.capture}{ending}")
    faults, _ = photographer.check_round(CHECKS)
    assert any(line in fault for fault in faults), faults
