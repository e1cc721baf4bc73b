"""A session whose dark counts are given takes no dark frames, and takes those counts off."""

import csv
from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image

import holobench_eval.display.simulated.profile as profiles
from holobench_eval.core.errors import UserError
from holobench_eval.lab.session.folder import FolderPhotographer
from holobench_eval.lab.session.manifest import CHECKS
from tests.lab.session.running import exported
from tests.lab.session.test_bench_checks import LAB
from tests.support.photographing import Lab

PROFILE = Path(profiles.__file__).parent / "profiles" / "leto-mild.yaml"
DARK = 900  # of the lab


@pytest.mark.parametrize("kind", ["level", "file of the bench"])
def test_given_dark_counts_stand_for_dark_frames(tmp_path: Path, kind: str) -> None:
    lab, options = Lab(*LAB, dark=DARK), ("--dark", DARK)
    if kind == "file of the bench":
        np.save(tmp_path / "my dark.npy", np.full(lab.bench.response.shape[-2:], DARK, np.float32))
        options = described(tmp_path, capture={"dark_frames": 0, "dark": "my dark.npy"})
    folder = exported(tmp_path, "double_phase", "leto-mild", *options)
    for name in ("round-1", "checks"):
        rows = list(csv.DictReader((folder / "patterns" / name / "order.csv").read_text().splitlines()))
        assert {row["laser"] for row in rows} == {"on"}
    lab.photograph_round(folder, 1)
    photographer = FolderPhotographer(folder)
    pattern = photographer.manifest.of_round(1)[0]
    light, counts = photographer.light(pattern), photographer.counts(pattern)
    assert np.allclose(light * pattern.exposure, counts - DARK, atol=1e-2)
    if kind == "file of the bench":
        (copy,) = folder.glob("dark-*.npy")
        np.save(copy, np.zeros(counts.shape, np.float32))
        with pytest.raises(UserError, match="has changed since the session was exported"):
            FolderPhotographer(folder).light(pattern)


def described(folder: Path, **bench: object) -> tuple[str, Path]:
    """The options of an export with a bench file."""
    panel = yaml.safe_load(PROFILE.read_text())["panel"] | {"shape": [144, 144]}
    (folder / "dark.yaml").write_text(yaml.safe_dump({"name": "lab", "version": 1, "panel": panel, **bench}))
    return "--bench", folder / "dark.yaml"


def test_given_dark_counts_go_before_those_of_the_bench_file_whatever_the_files_are_called(tmp_path: Path) -> None:
    for name, level in (("dark.npy", 64), ("new/dark.npy", 80)):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        np.save(tmp_path / name, np.full((100, 100), level, np.uint16))
    options = described(tmp_path, capture={"dark_frames": 0, "dark": "dark.npy"})
    folder = exported(tmp_path, "double_phase", "leto-mild", *options, "--dark", tmp_path / "new" / "dark.npy")
    assert FolderPhotographer(folder).dark_of(1, 0).bias.mean() == 80


@pytest.mark.parametrize(
    ("ending", "dark", "line"),
    [
        (".png", np.uint8(20), "has 8 bits and the photograph 16"),
        (".jpg", np.uint8(20), "compressed with loss, no counts to take dark ones off"),
    ],
)
def test_photographs_on_another_scale_than_the_given_dark_counts_are_a_fault(
    tmp_path: Path, ending: str, dark: np.generic, line: str
) -> None:
    np.save(tmp_path / "dark.npy", np.full((100, 100), dark))
    folder = exported(tmp_path, "double_phase", "leto-mild", *described(tmp_path), "--dark", tmp_path / "dark.npy")
    photographer, draw = FolderPhotographer(folder), np.random.default_rng(0)
    for pattern in photographer.manifest.of_round(CHECKS):
        counts = draw.integers(0, 250, (100, 100)).astype(np.uint16) * (1 if ending == ".jpg" else 256)
        picture = Image.fromarray(counts.astype(np.uint8) if ending == ".jpg" else counts)
        picture.save(folder / f"{pattern.capture}{ending}")
    faults, _ = photographer.check_round(CHECKS)
    assert any(line in fault for fault in faults), faults
