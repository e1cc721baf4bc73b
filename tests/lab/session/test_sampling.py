"""The same photographs give the same number, whether a session imports them or ``holoeval score`` reads them."""

from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest

from holobench_eval.core.hashing import digest
from holobench_eval.lab.session import read_manifest, session_photographer
from holobench_eval.optics.colour import srgb_encode
from holobench_eval.study.config import load_study
from holobench_eval.study.displays import displays
from tests.lab.session.running import succeed
from tests.study.studies import write_study
from tests.support.photographing import Lab


def save(path: Path, picture: np.ndarray) -> None:
    """``(3, h, w)`` in [0, 1] with 16 bits."""
    path.parent.mkdir(parents=True, exist_ok=True)
    levels = (picture.clip(0, 1) * 65535).round().astype(np.uint16)
    assert cv2.imwrite(str(path), np.ascontiguousarray(levels[::-1].transpose(1, 2, 0)))


def lay_out(session: Path, folder: Path) -> None:
    """The photographs of a session and its targets as folders of pictures, linear light without dark level."""
    study, photographer = load_study(session / "study.yaml"), session_photographer(session)
    region = next(iter(displays(study).values())).spec.region
    for item in study.dataset.items():
        save(folder / "targets" / f"{item}.png", srgb_encode(study.dataset.load(item, region.shape)).numpy())
        shown = [pattern for pattern in read_manifest(session).patterns if pattern.target == digest(item)]
        light = np.stack([photographer.light(pattern) for pattern in sorted(shown, key=lambda each: each.colour)])
        save(folder / "captures" / "wirtinger" / f"{item}.png", light / light.max())


def test_import_and_score_give_the_same_number_for_the_same_photographs(tmp_path: Path) -> None:
    session, display = tmp_path / "bench", "{profiles: [leto-mild], panel: [208, 208]}"
    method, scores = "{name: wirtinger, params: {iterations: 20}}", "{metrics: [psnr, ssim]}"
    config = write_study(tmp_path / "study.yaml", method, display=display, protocol=scores)
    succeed("session", "export", config, session)
    Lab("leto-mild", (208, 208), seed=1).photograph_round(session, 1)
    succeed("session", "import", session)
    lay_out(session, tmp_path)
    pictures = ("--captures", tmp_path / "captures", "--targets", tmp_path / "targets")
    succeed("score", *pictures, "--output", tmp_path / "scored", "--values", "linear")
    imported, scored = (
        pd.read_csv(folder / "table.csv").set_index("label").loc["wirtinger"]
        for folder in (session / "report", tmp_path / "scored")
    )
    assert imported["psnr_linear_db"] == pytest.approx(scored["psnr_linear_db"], abs=0.1)
    assert imported["ssim_linear"] == pytest.approx(scored["ssim_linear"], abs=0.01)
