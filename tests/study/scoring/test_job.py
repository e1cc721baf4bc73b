"""A cell's target is loaded once for all methods and repeats and nobody spoils it; pictures that are kept of a cell."""

import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from holobench_eval.core.errors import CellError
from holobench_eval.datasets.charts import Charts
from holobench_eval.study.scoring.job import TargetSource, load_target
from holobench_eval.study.scoring.pictures import write_capture, write_phase, write_thumbnail

FOLDER = Path("of this test")


def source(item: str, params: str = "{}", sha256: str = "") -> TargetSource:
    return "charts", "", params, FOLDER, item, sha256 or Charts().digest(item)


def place(side: int) -> Any:
    return SimpleNamespace(spec=SimpleNamespace(region=SimpleNamespace(shape=(side, side)), wavelengths=(1, 2, 3)))


def test_a_target_is_loaded_once_and_given_unspoiled(monkeypatch):
    load, loads = Charts.load, list[Any]()
    counted = lambda self, *given, **named: loads.append(given) or load(self, *given, **named)  # noqa: E731
    monkeypatch.setattr(Charts, "load", counted)
    first = load_target(source("tv_lines"), place(40))
    first.zero_()
    other = load_target(source("gray_ramp", '{"names":["gray_ramp"]}'), place(40))
    assert torch.equal(other, load(Charts(), "gray_ramp", (40, 40)))
    assert load_target(source("tv_lines"), place(48)).shape == (3, 48, 48)
    again = load_target(source("tv_lines"), place(40))
    assert torch.equal(again, load(Charts(), "tv_lines", (40, 40)))
    assert loads == [("tv_lines", (40, 40)), ("gray_ramp", (40, 40)), ("tv_lines", (48, 48))]


def test_a_target_that_changed_since_the_plan_is_refused():
    with pytest.raises(CellError, match="'tv_lines' has changed since the study was planned"):
        load_target(source("tv_lines", sha256="another"), place(40))


def test_a_target_that_is_black_is_refused_before_anything_is_solved(monkeypatch):
    monkeypatch.setattr(Charts, "load", lambda self, item, shape, channels=3: torch.zeros(channels, *shape))
    with pytest.raises(CellError, match="target 'tv_lines' is black; expected light in at least one of its colours"):
        load_target(source("tv_lines"), place(33))


def read(path: Path) -> NDArray[np.integer]:
    """Red, green, blue, or gray."""
    picture = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert picture is not None
    return np.asarray(picture[..., ::-1] if picture.ndim == 3 else picture)


def test_a_thumbnail_is_srgb_with_red_first_and_at_most_512_pixels_long(tmp_path):
    linear = torch.zeros(3, 4, 6)
    linear[0] = 0.5
    write_thumbnail(tmp_path / "a.png", linear)
    assert read(tmp_path / "a.png").shape == (4, 6, 3)
    assert read(tmp_path / "a.png")[0, 0].tolist() == [188, 0, 0]
    write_thumbnail(tmp_path / "a.png", torch.rand(3, 300, 1024))
    assert read(tmp_path / "a.png").shape == (150, 512, 3)


@pytest.mark.parametrize("brightest", [3.7, 0.0])
def test_a_capture_comes_back_through_its_scale(tmp_path, brightest):
    linear = torch.rand(3, 8, 9) * brightest
    write_capture(tmp_path / "a.png", linear)
    scale = json.loads((tmp_path / "a.json").read_text())["scale"]
    again = torch.from_numpy(read(tmp_path / "a.png").astype(np.float64) * scale).permute(2, 0, 1)
    torch.testing.assert_close(again, linear.double(), atol=scale if brightest else 0, rtol=0)


def test_phase_levels_span_one_turn_and_wrap_and_are_gray_where_the_phase_is_monochrome(tmp_path):
    turn = torch.tensor([0.0, math.pi, -math.pi, 2 * math.pi, 255 / 256 * 2 * math.pi, 255.6 / 256 * 2 * math.pi])
    for channels, place in ((3, (0, slice(None), 1)), (1, 0)):
        write_phase(tmp_path / "a.png", turn.expand(channels, 2, 6))
        assert read(tmp_path / "a.png")[place].tolist() == [0, 128, 128, 0, 255, 0]
