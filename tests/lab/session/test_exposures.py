"""Frames of one exposure through the files of a session: several patterns, one photograph, the score of the display."""

import csv
import json
from pathlib import Path

import cv2
import pandas as pd
import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.lab.session import read_manifest
from tests.lab.session.running import exported, succeed, told
from tests.support.photographing import Lab

PROFILE = """\
name: fast
like: leto-mild
version: 1
description: leto-mild with a fast panel.
panel: {frames: 4, wavelengths: [5.17e-7]}
"""
METHODS = (
    "{name: random_frames, label: four, params: {frames: 4, iterations: 5}}, "
    "{name: random_frames, label: one, params: {iterations: 5}}"
)


def psnr(report: Path) -> pd.Series:
    return pd.read_csv(report / "table.csv").set_index("label")["psnr_linear_db"]


def test_frames_are_photographed_once_and_score_as_on_the_display_itself(tmp_path: Path) -> None:
    (tmp_path / "fast.yaml").write_text(PROFILE)
    folder = exported(tmp_path, METHODS, "fast.yaml", "--dark", 900, panel=128)
    rows = list(csv.DictReader((folder / "patterns" / "round-1" / "order.csv").read_text().splitlines()))
    several = [row for row in rows if " " in row["show"]]
    assert len(several) == 1
    first, *others = several[0]["show"].split()
    assert others == [first.replace(".png", f"-frame-{frame}.png") for frame in (2, 3, 4)]
    assert len({row["save_photograph_as"] for row in rows}) == len(rows)
    Lab(str(tmp_path / "fast.yaml"), (128, 128), seed=1).photograph_round(folder, 1)

    study = ("--study", tmp_path / "study.yaml")
    levels = cv2.imread(str(folder / others[0]), cv2.IMREAD_UNCHANGED)
    cv2.imwrite(str(folder / others[0]), 255 - levels)
    assert f"{others[0]}: is not the pattern that was exported" in told("import", folder, *study)[1]
    cv2.imwrite(str(folder / others[0]), levels)

    succeed("session", "import", folder, *study)
    succeed("run", study[1], "--output", tmp_path / "direct", "--executor", "serial")
    ours, direct = psnr(folder / "report"), psnr(tmp_path / "direct")
    for label in ("four", "one"):
        assert ours[label] == pytest.approx(direct[label], abs=0.7)  # means over pixels, samples at points
    assert ours["four"] - ours["one"] == pytest.approx(direct["four"] - direct["one"], abs=0.4)
    assert ours["four"] > ours["one"] + 1
    records = pd.read_csv(folder / "report" / "records.csv").set_index("label")
    assert records.loc["four", ["frames", "captures"]].tolist() == [4, 0]


def test_a_manifest_with_another_name_for_a_frame_is_refused(tmp_path: Path) -> None:
    (tmp_path / "fast.yaml").write_text(PROFILE)
    folder = exported(tmp_path, METHODS, "fast.yaml", "--dark", 900, panel=128)
    content = json.loads((folder / "manifest.json").read_text())
    shared = next(pattern for pattern in content["patterns"] if pattern["frames"])
    shared["frames"].reverse()
    (folder / "manifest.json").write_text(json.dumps(content))
    with pytest.raises(UserError, match=r"file 'patterns/round-1/\d+-frame-4.png' should be '.*-frame-2.png'"):
        read_manifest(folder)
