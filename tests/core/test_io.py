"""Pictures as integer levels: what is stored comes back, whatever library would have made of it."""

import cv2
import numpy as np
import pytest
import torch
from PIL import Image

from holobench_eval.core.io import decode_levels, write_png


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("bits", [8, 16])
def test_levels_of_a_png_come_back_as_they_were_written(tmp_path, channels, bits):
    kind = np.uint8 if bits == 8 else np.uint16
    levels = np.random.default_rng(0).integers(0, 2**bits, (channels, 6, 5), dtype=np.int64)
    write_png(tmp_path / "a.png", torch.from_numpy(levels), bits)
    decoded = decode_levels((tmp_path / "a.png").read_bytes())
    assert decoded.dtype == kind
    assert np.array_equal(decoded, levels[0] if channels == 1 else levels.transpose(1, 2, 0))


def test_red_is_first_and_alpha_last(tmp_path):
    Image.new("RGBA", (2, 3), (10, 20, 30, 40)).save(tmp_path / "a.png")
    assert decode_levels((tmp_path / "a.png").read_bytes())[0, 0].tolist() == [10, 20, 30, 40]


def test_what_has_no_levels_of_8_or_16_bits_is_none():
    floating = cv2.imencode(".tiff", np.ones((4, 4), np.float32))[1].tobytes()
    assert decode_levels(floating) is None
    assert decode_levels(b"no picture") is None


def test_a_picture_of_two_channels_is_refused_and_no_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cv2, "imdecode", lambda *_: np.zeros((4, 4, 2), np.uint8))
    assert decode_levels(b"two channels") is None
