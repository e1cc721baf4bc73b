"""Captures as other software saves them: every kind of file gives the same values."""

from pathlib import Path

import numpy as np
import pytest
import tifffile
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from holobench_eval.core.errors import UserError
from holobench_eval.lab.dark import Dark, given_dark
from holobench_eval.optics.colour import srgb_decode
from holobench_eval.study.folders.doubts import LIFTED
from holobench_eval.study.folders.exposure import darkest
from holobench_eval.study.folders.files import read_folders
from holobench_eval.study.folders.pictures import checked
from tests.study.studies import one_line
from tests.support.photographed import photograph, save

COLOUR = photograph("coffee", (48, 64))  # (3, h, w)
LEVELS = np.round(COLOUR * 60000).astype(np.uint16)
FLOATS = (COLOUR * 900 - 30).astype(np.float32)  # averaged counts above dark: noise makes some of them negative


def planar(path: Path, values: np.ndarray) -> None:
    tifffile.imwrite(path, values, photometric="rgb", planarconfig="separate")


def interleaved(path: Path, values: np.ndarray) -> None:
    tifffile.imwrite(path, np.ascontiguousarray(values.transpose(1, 2, 0)), photometric="rgb")


def inverted(path: Path, values: np.ndarray) -> None:
    tifffile.imwrite(path, ~values[1], photometric="miniswhite")


@pytest.mark.parametrize(("write", "wanted"), [(planar, LEVELS), (interleaved, LEVELS), (inverted, LEVELS[1:2])])
def test_sixteen_bit_tiffs_of_any_layout_have_the_same_values(tmp_path, write, wanted):
    write(tmp_path / "x.tif", LEVELS)
    assert np.allclose(checked(tmp_path / "x.tif").load(), wanted / 65535, atol=1e-7)


def test_numbers_of_another_byte_order_are_the_same_numbers(tmp_path):
    np.save(tmp_path / "x.npy", LEVELS.astype(">u2"))
    assert np.allclose(checked(tmp_path / "x.npy", linear=True).load(), LEVELS / 65535, atol=1e-7)


@pytest.mark.parametrize("form", ["planar", "interleaved", "colours last", "colours first", "double"])
def test_floating_point_is_read_over_its_highest_value(tmp_path, form):
    path = tmp_path / ("x.tif" if form in ("planar", "interleaved") else "x.npy")
    if form in ("planar", "interleaved"):
        (planar if form == "planar" else interleaved)(path, FLOATS)
    else:
        values = FLOATS.astype(np.float64) if form == "double" else FLOATS
        np.save(path, values.transpose(1, 2, 0) if form == "colours last" else values)
    picture = checked(path)
    assert picture.is_linear
    assert np.allclose(picture.load(), FLOATS / FLOATS.max(), atol=1e-6)
    assert picture.load().min() < 0


@pytest.mark.parametrize(
    ("values", "line"),
    [
        (np.where(FLOATS > 100, np.nan, FLOATS), "NaN or infinite"),
        (-np.abs(FLOATS), "no value is above 0"),
        (FLOATS.astype(np.int32), "an array of int32"),
        (FLOATS.astype(complex), "an array of complex128"),
        (FLOATS[:2], "an array of 2 x 48 x 64"),
        (FLOATS[0, 0], "an array of 64"),
    ],
)
def test_numbers_that_are_no_photograph_are_refused_in_one_line(tmp_path, values, line):
    np.save(tmp_path / "x.npy", values)
    with one_line(line):
        checked(tmp_path / "x.npy")


def test_a_target_of_floating_point_is_refused(tmp_path):
    save(tmp_path / "captures" / "m" / "coffee.png", COLOUR)
    (tmp_path / "targets").mkdir()
    interleaved(tmp_path / "targets" / "coffee.tif", FLOATS)
    with pytest.raises(UserError, match=r"coffee.tif: floating point; expected a target in sRGB"):
        read_folders(tmp_path / "captures", tmp_path / "targets", linear=True)


def test_light_is_above_the_dark_counts_and_a_capture_that_has_none_is_refused(tmp_path):
    interleaved(tmp_path / "x.tif", LEVELS)
    picture = checked(tmp_path / "x.tif", linear=True, dark=given_dark("9000")[0])
    assert np.allclose(picture.light(), (LEVELS.astype(float) - 9000) / 65535, atol=1e-6)
    assert np.allclose(picture.load(), LEVELS / 65535, atol=1e-7)
    with pytest.raises(UserError, match=r"x.tif: on average no brighter than the dark counts"):
        checked(tmp_path / "x.tif", linear=True, dark=given_dark("60000")[0])


@pytest.mark.parametrize("shape", [(1, 48, 64), (48, 64, 1)])
def test_gray_numbers_may_have_one_colour_first_or_last(tmp_path, shape):
    np.save(tmp_path / "x.npy", FLOATS[1].reshape(shape))
    assert np.allclose(checked(tmp_path / "x.npy").load()[0], FLOATS[1] / FLOATS[1].max(), atol=1e-6)


@pytest.mark.parametrize(("shift", "last"), [(0, 4095), (4, 65520), (6, 64 * 1023)])
def test_a_camera_of_fewer_bits_clips_at_its_own_last_level(tmp_path, shift, last):
    bits = last >> shift
    counts = np.minimum(np.round(COLOUR * 2 * bits), bits).astype(np.uint16) << shift
    interleaved(tmp_path / "x.tif", counts)
    picture = checked(tmp_path / "x.tif")
    assert (picture.load() >= picture.full).mean() == (counts == last).mean() > 0.05
    interleaved(tmp_path / "y.tif", np.minimum(counts, last // 2))
    assert checked(tmp_path / "y.tif").full == 1 or shift == 0


TARGET = srgb_decode(torch.from_numpy(photograph("astronaut", (80, 100)))).double()
MEAN = float(TARGET.mean())


@settings(max_examples=40, deadline=None)
@given(black=st.floats(0.1, 2.0), gain=st.floats(1e-3, 1e6))
def test_a_constant_is_seen_at_any_gain_and_not_once_it_is_taken_off(black, gain):
    """black: of the mean of the light."""
    counts = gain * (TARGET + black * MEAN)
    lifted = darkest(counts, TARGET)
    assert lifted == pytest.approx(darkest(TARGET + black * MEAN, TARGET), rel=1e-6)
    assert lifted > 0.8 * black * MEAN / (1 + black)
    light = Dark(np.array(gain * black * MEAN)).off(counts.numpy())
    assert abs(darkest(torch.from_numpy(light), TARGET)) < 1e-3 < LIFTED
    assert darkest(TARGET - black * MEAN / 2, TARGET) < 0  # too much was taken off
