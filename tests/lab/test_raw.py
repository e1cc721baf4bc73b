"""RAW files become the counts of the sensor, untouched."""

import cv2
import numpy as np
import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.lab.raw import read_raw
from tests.support.bayer import bayer_dng

pytest.importorskip("rawpy")

MOSAIC = np.random.default_rng(4).integers(0, 16383, (64, 96), dtype=np.uint16)


def test_counts_are_those_of_the_photosites_and_nothing_is_interpolated() -> None:
    frame = read_raw(bayer_dng(MOSAIC))
    assert frame.counts.shape == (32, 48, 3)
    assert frame.counts.dtype == np.uint16
    assert np.array_equal(frame.counts[..., 0], MOSAIC[::2, ::2])
    assert np.array_equal(frame.counts[..., 2], MOSAIC[1::2, 1::2])
    greens = (MOSAIC[::2, 1::2].astype(float) + MOSAIC[1::2, ::2]) / 2
    assert np.array_equal(frame.counts[..., 1], np.rint(greens))
    assert frame.white == 16383


@pytest.mark.parametrize("pattern", ["GRBG", "BGGR"])
def test_colours_are_found_wherever_the_mosaic_begins(pattern: str) -> None:
    frame = read_raw(bayer_dng(MOSAIC, pattern=bytes("RGB".index(letter) for letter in pattern)))
    for plane, letter in ((0, "R"), (2, "B")):
        row, column = divmod(pattern.index(letter), 2)
        assert np.array_equal(frame.counts[..., plane], MOSAIC[row::2, column::2])


def test_a_green_pair_with_one_saturated_site_is_saturated() -> None:
    mosaic = np.full((64, 96), 1000, np.uint16)
    mosaic[0, 1] = 16383
    assert read_raw(bayer_dng(mosaic)).counts[0, 0].tolist() == [1000, 16383, 1000]


def test_what_is_no_raw_file_is_refused_in_one_line() -> None:
    picture = cv2.imencode(".jpg", np.zeros((64, 96, 3), np.uint8))[1].tobytes()
    with pytest.raises(UserError, match=r"a\.cr2: a JPEG, whose values are not linear in light"):
        read_raw(picture, "a.cr2")
    for content in (b"", b"\x00" * 4096, bayer_dng(MOSAIC)[:5000], bayer_dng(MOSAIC)[:200]):
        with pytest.raises(UserError, match=r"^a\.dng: not a RAW file that LibRaw can read \([A-Z][^\n']+\)$"):
            read_raw(content, "a.dng")
    with pytest.raises(UserError, match="Bayer"):
        read_raw(bayer_dng(MOSAIC, pattern=bytes([0, 0, 1, 2])), "a.dng")
