"""A session whose dark counts are given takes no dark frames, and takes those counts off."""

import csv
from pathlib import Path

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

import holobench_eval.display.simulated.profile as profiles
from holobench_eval.commands import app
from holobench_eval.core.errors import UserError
from holobench_eval.lab.session.folder import FolderPhotographer
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
        np.save(folder / "dark.npy", np.zeros(counts.shape, np.float32))
        with pytest.raises(UserError, match="has changed since the session was exported"):
            FolderPhotographer(folder).light(pattern)
