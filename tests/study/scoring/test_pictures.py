from __future__ import annotations

import json
import math
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from holobench_eval.study.scoring.pictures import write_capture, write_phase, write_thumbnail


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
