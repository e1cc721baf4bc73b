"""``holoeval score`` on photographs as laboratories have them: one laser, too dark, cut off, speckled, aligned."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from rich.console import Console

from holobench_eval.commands.score import score_folders
from holobench_eval.core.errors import UserError
from holobench_eval.metrics import score
from holobench_eval.study.folders import scoring as scored_pictures
from tests.support.bayer import bayer_dng
from tests.support.photographed import Picture, captured, photograph, pose, save
from tests.support.reports import whole

SHAPE = (160, 200)
KEY = "psnr_stored_db"


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Only the two metrics that are quick."""

    def few(*pictures: Any, **options: Any) -> dict[str, float]:
        return score(*pictures, **{**options, "metrics": ("psnr", "ssim")})

    monkeypatch.setattr(scored_pictures, "score", few)


def run(root: Path, values: str = "stored", **options: Any) -> tuple[str, str, pd.DataFrame]:
    """The whole report, what the terminal shows, and the records of captures by method and target."""
    console = Console(file=io.StringIO(), width=200)
    report, _ = score_folders(root / "captures", root / "targets", root / "out", values, None, None, console, **options)
    records = pd.read_csv(root / "out" / "records.csv").set_index(["label", "target"])
    return whole(report), console.file.getvalue(), records[records["category"] == "given"]


def gray(picture: Picture) -> Picture:
    return np.repeat(picture.mean(axis=0, keepdims=True), 3, axis=0)


def test_one_laser_in_a_colour_photograph_is_scored_on_its_channel_and_methods_keep_their_order(tmp_path):
    target = gray(photograph("astronaut", SHAPE))
    where, size = pose(np.random.default_rng(1), SHAPE, scale=1.3)
    save(tmp_path / "targets" / "astronaut.png", target)
    for method, contrast, noise in (("better", 0.3, 0.03), ("worse", 0.5, 0.0)):
        draw = np.random.default_rng(2)
        capture = captured(target, where, size, draw, contrast=contrast)
        save(tmp_path / "captures" / f"plane of {method}" / "astronaut.png", capture[:1])
        capture[1:] = np.abs(noise * draw.standard_normal(capture[1:].shape))
        save(tmp_path / "captures" / method / "astronaut.png", capture)
    text, terminal, records = run(tmp_path)
    found = records[KEY].droplevel("target")
    assert found["better"] > found["worse"] + 0.5
    assert found["better"] == pytest.approx(found["plane of better"], abs=0.01)
    for said in (text, terminal):
        assert "Scored on the red channel alone" in said
        assert "better/astronaut, worse/astronaut" in said


def test_an_under_exposed_capture_has_no_score_and_is_never_the_best(tmp_path):
    target = photograph("astronaut", SHAPE)
    where, size = pose(np.random.default_rng(1), SHAPE, scale=1.3)
    save(tmp_path / "targets" / "astronaut.png", target)
    speckled = captured(target, where, size, np.random.default_rng(2), contrast=0.7)
    save(tmp_path / "captures" / "speckled" / "astronaut.png", speckled)
    clean = captured(target, where, size, np.random.default_rng(2), contrast=0)
    save(tmp_path / "captures" / "dark" / "astronaut.png", clean * 3 / 255)
    text, _, records = run(tmp_path)
    assert records["state"].droplevel("target").to_dict() == {"dark": "failed", "speckled": "done"}
    assert "under-exposed: it has 4 levels" in text
    assert records["reason"].str.contains("under-exposed").sum() == 1


def test_raw_files_are_scored_as_linear_light_alone(tmp_path):
    pytest.importorskip("rawpy")
    target = photograph("astronaut", SHAPE)[:1]
    save(tmp_path / "targets" / "astronaut.png", target)
    where, size = pose(np.random.default_rng(1), SHAPE, scale=1.3)
    light = captured(np.repeat(target, 3, axis=0), where, size, np.random.default_rng(2), contrast=0.2)[0] ** 2.2
    mosaic = np.full((2 * light.shape[0], 2 * light.shape[1]), 512, np.uint16)
    mosaic[::2, ::2] += np.round(light * 15000).astype(np.uint16)
    (tmp_path / "captures" / "m").mkdir(parents=True)
    (tmp_path / "captures" / "m" / "astronaut.dng").write_bytes(bayer_dng(mosaic))
    with pytest.raises(UserError, match="a RAW file holds linear light; expected --values linear"):
        run(tmp_path)
    _, _, records = run(tmp_path, values="linear")
    assert records.loc[("m", "astronaut"), "psnr_linear_db"] > 18
