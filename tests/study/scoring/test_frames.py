"""Holograms of several frames, from a method to the files of a study."""

from pathlib import Path
from typing import Any

import numpy as np

from holobench_eval.report import facts_of, records_frame
from holobench_eval.study.config import load_study
from tests.study.studies import compute
from tests.support import synthetic_study as synthetic

METHODS = """
import torch

def several(target, bench, frames: int = 1, wrong: bool = False):
    shape = (len(target), frames, target.shape[1], *bench.spec.shape)
    phase = 6 * torch.rand(shape, generator=bench.generator("frames"))
    return phase[..., 1:] if wrong else phase

def looks(target, bench):
    phase = torch.zeros(target.shape[1], *bench.spec.shape)
    for _ in range(3):
        bench.capture(phase)
    return phase.expand(1, 4, *phase.shape)

looks.camera = True
"""
STUDY = """
title: frames
seed: 1
display: {{profiles: [{display}], panel: [128, 128]}}
targets: {{dataset: photographs, params: {{names: [camera]}}}}
protocol: {{metrics: [psnr]}}
save: {{phases: true}}
methods: [{methods}]
"""


def records_of(tmp_path: Path, display: str, *methods: str, name: str = "several") -> list[dict[str, Any]]:
    (tmp_path / "mine.py").write_text(METHODS)
    listed = ", ".join(f"{{name: 'mine.py:{name}', label: m{i}, {params}}}" for i, params in enumerate(methods))
    (tmp_path / "study.yaml").write_text(STUDY.format(display=display, methods=listed))
    records = compute(tmp_path / "study.yaml", tmp_path / "out").records
    return [record for record in records if record["label"].startswith("m")]


def test_frames_are_counted_kept_and_shown_together(tmp_path):
    one, four, nine, wrong = records = records_of(
        tmp_path, "flc-1bit", "", "params: {frames: 4}", "params: {frames: 9}", "params: {frames: 2, wrong: true}"
    )
    assert [record["frames"] for record in (one, four)] == [1, 4]
    assert "m2: phase has 9 frames, the display shows 8 at most in an exposure" in nine["reason"]
    assert "m3: phase is (2, 3, 128, 127), the display shows (C, 128, 128)" in wrong["reason"]
    frame = records_frame(records, facts_of(load_study(tmp_path / "study.yaml")))
    assert frame["frames"].tolist()[:2] == [1, 4]
    assert frame["panel_time"].tolist()[:2] == [1, 4]
    saved = tmp_path / "out" / "phases"
    assert np.load(next((saved / "m0").rglob("*.npy"))).shape == (3, 128, 128)
    assert np.load(next((saved / "m1").rglob("*.npy"))).shape == (4, 3, 128, 128)
    assert len(list((saved / "m1").rglob("*-frame-*.png"))) == 4
    assert four["scores"]["psnr_linear"] > one["scores"]["psnr_linear"] + 1  # speckle of four adds up to less


def test_a_study_of_single_frames_has_no_column_of_them(tmp_path):
    (record,) = records = records_of(tmp_path, "ideal", "")
    assert record["state"] == "done"
    frame = records_frame(records, facts_of(load_study(tmp_path / "study.yaml")))
    assert not {"frames", "panel_time"} & set(frame)


def test_panel_time_counts_the_frames_of_every_capture():
    counts = [{"frames": 8, "captures": 0}, {"frames": 8, "captures": 50}, {"captures": 50}]
    counts += [{"frames": 8, "captures": None}, {"frames": 4, "captures": 5, "shown": 5}]
    records = [
        synthetic.record("m", synthetic.cell("m", f"t{place}", "ideal"), {"psnr_linear": 1.0}, **each)
        for place, each in enumerate(counts)
    ]
    results = synthetic.results(records, baseline=None)
    assert results.frame["panel_time"].fillna(-1).tolist() == [8, 408, 51, -1, 9]


def test_a_method_may_photograph_one_frame_and_give_several(tmp_path):
    (record,) = records_of(tmp_path, "flc-1bit", "", name="looks")
    assert (record["captures"], record["shown"], record["frames"]) == (3, 3, 4)
