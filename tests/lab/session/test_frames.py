"""Photographs as people save them: linear counts out of every kind of file, and one line for what is none."""

import cv2
import numpy as np
import pytest
from PIL import Image

from holobench_eval.core.errors import UserError
from holobench_eval.lab import raw
from holobench_eval.lab.session.frames import facts, find, read_frame
from tests.support.bayer import bayer_dng


@pytest.fixture
def counts():
    return np.random.default_rng(0).integers(0, 4096, (24, 32), dtype=np.uint16)


@pytest.mark.parametrize("ending", [".png", ".tif", ".TIFF"])
def test_sixteen_bits_come_back_as_they_were_counted(tmp_path, counts, ending):
    path = tmp_path / f"0001{ending}"
    Image.fromarray(counts).save(path)
    frame = read_frame(find(tmp_path, "0001"), colour=0)
    assert find(tmp_path, "0002") is None
    assert np.array_equal(frame.counts, counts)
    assert frame.linear
    assert frame.top == 65535


def test_a_colour_photograph_gives_the_channel_of_its_laser_and_twelve_bits_their_step(tmp_path, counts):
    picture = np.zeros((8, 8, 3), np.uint8)
    picture[...] = (10, 20, 30)
    Image.fromarray(picture).save(tmp_path / "0001.png")
    assert [read_frame(tmp_path / "0001.png", colour).counts[0, 0] for colour in range(3)] == [10, 20, 30]
    cv2.imwrite(str(tmp_path / "0001.png"), counts << 4)
    assert facts(read_frame(tmp_path / "0001.png", 0)).step == 16
    cv2.imwrite(str(tmp_path / "0001.png"), counts)
    assert facts(read_frame(tmp_path / "0001.png", 0)).step == 1


def test_camera_raw_gives_the_sites_of_its_colour(tmp_path):
    mosaic = np.tile(np.array([[100, 200], [200, 300]], np.uint16), (16, 16))
    (tmp_path / "0001.dng").write_bytes(bayer_dng(mosaic))
    seen = [read_frame(tmp_path / "0001.dng", colour).counts for colour in range(3)]
    assert [float(plane.mean()) for plane in seen] == [100, 200, 300]
    assert seen[0].shape == (16, 16)


def test_a_jpeg_is_decoded_and_called_not_linear(tmp_path):
    Image.fromarray(np.full((16, 16), 188, np.uint8)).save(tmp_path / "0001.jpg", quality=100)
    frame = read_frame(tmp_path / "0001.jpg", 0)
    assert not frame.linear
    assert float(frame.counts.mean()) == pytest.approx(0.503 * 255, rel=0.01)


def test_what_is_no_photograph_is_one_line(tmp_path):
    (tmp_path / "text.png").write_text("not a picture")
    Image.new("RGBA", (8, 8)).save(tmp_path / "alpha.png")
    Image.new("L", (14_200, 14_200)).save(tmp_path / "huge.png")
    frames = [Image.new("L", (8, 8), value) for value in (1, 2)]
    frames[0].save(tmp_path / "many.tif", save_all=True, append_images=frames[1:])
    for name, line in (
        ("text", "not an image"),
        ("alpha", "alpha that is not opaque"),
        ("huge", "200 million"),
        ("many", "2 frames or pages"),
    ):
        with pytest.raises(UserError, match=line) as caught:
            read_frame(find(tmp_path, name), 0)
        assert "\n" not in str(caught.value)


def test_a_tiff_without_its_size_and_two_files_for_one_photograph_are_one_line(tmp_path, counts):
    path = tmp_path / "0001.tif"
    Image.fromarray(counts).save(path)
    content = bytearray(path.read_bytes())
    start = int.from_bytes(content[4:8], "little") + 2
    for entry in range(start, len(content) - 12, 12):
        if content[entry : entry + 2] in (b"\x00\x01", b"\x01\x01"):  # the tags of width and height
            content[entry : entry + 2] = b"\xff\xff"
    path.write_bytes(content)
    with pytest.raises(UserError, match="damaged"):
        read_frame(path, 0)
    Image.new("L", (8, 8)).save(tmp_path / "0001.png")
    with pytest.raises(UserError, match="keep one of these"):
        find(tmp_path, "0001")


MOSAIC = np.random.default_rng(4).integers(0, 16383, (64, 96), dtype=np.uint16)


def read_raw(content: bytes, *name: str) -> raw.RawFrame:
    pytest.importorskip("rawpy")
    return raw.read_raw(content, *name)


def test_counts_are_those_of_the_photosites_and_saturate_with_them() -> None:
    frame = read_raw(bayer_dng(MOSAIC))
    assert frame.counts.shape == (32, 48, 3)
    assert frame.counts.dtype == np.uint16
    assert np.array_equal(frame.counts[..., 0], MOSAIC[::2, ::2])
    assert np.array_equal(frame.counts[..., 2], MOSAIC[1::2, 1::2])
    greens = (MOSAIC[::2, 1::2].astype(float) + MOSAIC[1::2, ::2]) / 2
    assert np.array_equal(frame.counts[..., 1], np.rint(greens))
    assert frame.white == 16383
    mosaic = np.full((64, 96), 1000, np.uint16)
    mosaic[0, 1] = 16383
    assert read_raw(bayer_dng(mosaic)).counts[0, 0].tolist() == [1000, 16383, 1000]


@pytest.mark.parametrize("pattern", ["GRBG", "BGGR"])
def test_colours_are_found_wherever_the_mosaic_begins(pattern: str) -> None:
    frame = read_raw(bayer_dng(MOSAIC, pattern=bytes("RGB".index(letter) for letter in pattern)))
    for plane, letter in ((0, "R"), (2, "B")):
        row, column = divmod(pattern.index(letter), 2)
        assert np.array_equal(frame.counts[..., plane], MOSAIC[row::2, column::2])


def test_what_is_no_raw_file_is_refused_in_one_line() -> None:
    picture = cv2.imencode(".jpg", np.zeros((64, 96, 3), np.uint8))[1].tobytes()
    with pytest.raises(UserError, match=r"a\.cr2: a JPEG, whose values are not linear in light"):
        read_raw(picture, "a.cr2")
    for content in (b"", b"\x00" * 4096, bayer_dng(MOSAIC)[:5000], bayer_dng(MOSAIC)[:200]):
        with pytest.raises(UserError, match=r"^a\.dng: not a RAW file that LibRaw can read \([A-Z][^\n']+\)$"):
            read_raw(content, "a.dng")
    with pytest.raises(UserError, match="Bayer"):
        read_raw(bayer_dng(MOSAIC, pattern=bytes([0, 0, 1, 2])), "a.dng")
