"""What of a capture is compared with its target: nothing is lost, nothing is guessed, and everything is said."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image, ImageCms

from holobench_eval.core.errors import UserError
from holobench_eval.study.folders.files import Folders, read_folders
from holobench_eval.study.folders.pictures import checked
from tests.support.bayer import bayer_dng
from tests.support.photographed import Picture, photograph, save

COLOUR = photograph("coffee", (48, 64))
GRAY = COLOUR.mean(axis=0, keepdims=True)
EQUAL = np.repeat(GRAY, 3, axis=0)


def laser(channel: int, leak: float = 0.0) -> Picture:
    """A gray picture as a colour camera sees it in the light of one laser."""
    noise = np.random.default_rng(1).uniform(0, 0.04, EQUAL.shape)
    share = np.full((3, 1, 1), leak)
    share[channel] = 1
    return np.clip(EQUAL * share + noise, 0, 1).astype(np.float32)


def folders(root: Path, capture: Picture, target: Picture, name: str = "coffee.png") -> Folders:
    save(root / "captures" / "m" / name, capture)
    save(root / "targets" / "coffee.png", target)
    return read_folders(root / "captures", root / "targets")


@pytest.mark.parametrize(("channel", "name"), [(0, "red"), (1, "green"), (2, "blue")])
@pytest.mark.parametrize("target", [GRAY, EQUAL])
def test_the_channel_of_a_single_laser_is_compared_with_a_gray_target_and_that_is_said(tmp_path, channel, name, target):
    found = folders(tmp_path, laser(channel, leak=0.2), target)
    assert found.pairings["m", "coffee"].channel == name
    assert f"Scored on the {name} channel alone" in " ".join(found.notes)
    assert "m/coffee" in " ".join(found.notes)


def test_a_colour_target_in_the_light_of_one_laser_is_refused(tmp_path):
    refused = folders(tmp_path, laser(0), COLOUR).pairings["m", "coffee"].refused
    assert "light in its red channel alone and the target is in colour" in refused


@pytest.mark.parametrize("target", [COLOUR, EQUAL, np.concatenate([GRAY, 0 * GRAY, 0 * GRAY])])
def test_pictures_in_colour_are_compared_in_colour(tmp_path, target):
    found = folders(tmp_path, (target * [[[0.9]], [[0.5]], [[0.7]]]).astype(np.float32), target)
    assert found.pairings["m", "coffee"].channel == ""
    assert found.pairings["m", "coffee"].refused == ""
    assert found.notes == ()


@pytest.mark.parametrize(("capture", "target"), [(0.9 * EQUAL, GRAY), (0.9 * GRAY, EQUAL)])
def test_equal_channels_are_gray_and_that_is_said(tmp_path, capture, target):
    found = folders(tmp_path, capture, target)
    assert found.pairings["m", "coffee"].channel == "gray"
    assert "Scored in gray, since the channels of the capture, or of its target, are equal: m/coffee" in found.notes[0]


@pytest.mark.parametrize(
    ("capture", "target", "why"),
    [
        (COLOUR, GRAY, "in colour and the target gray"),
        (laser(1, leak=0.6), GRAY, "1.00 in green"),
        (GRAY, COLOUR, "gray and the target in colour"),
    ],
)
def test_what_would_be_a_guess_is_refused(tmp_path, capture, target, why):
    pairing = folders(tmp_path, capture, target).pairings["m", "coffee"]
    assert why in pairing.refused
    assert "save the" in pairing.refused


@pytest.mark.parametrize("offset", [0, 12])
@pytest.mark.parametrize("scale", [1, 257])
def test_a_capture_of_a_few_dark_levels_is_refused(tmp_path, offset, scale):
    levels = (np.round(EQUAL * 3) + offset) * scale
    levels[:, 0, :2] = 255 * scale  # hot pixels
    folders(tmp_path, EQUAL, GRAY)
    picture = levels.astype(np.uint8 if scale == 1 else np.uint16).transpose(1, 2, 0)
    cv2.imwrite(str(tmp_path / "captures" / "m" / "coffee.png"), picture)
    refused = read_folders(tmp_path / "captures", tmp_path / "targets").pairings["m", "coffee"].refused
    assert "under-exposed: it has 4 levels" in refused


@pytest.mark.parametrize("capture", [EQUAL, EQUAL * 20 / 255, (EQUAL > 0.5).astype(np.float32)])
def test_a_dark_capture_of_enough_levels_and_a_bright_one_of_few_are_no_fault(tmp_path, capture):
    assert folders(tmp_path, capture, GRAY).pairings["m", "coffee"].refused == ""


@pytest.mark.parametrize("name", ["coffee.bmp", "coffee.webp", "coffee.tiff"])
@pytest.mark.parametrize("picture", [COLOUR, GRAY])
def test_the_formats_of_laboratories_are_read(tmp_path, name, picture):
    path = tmp_path / name
    levels = np.round(picture * 255).astype(np.uint8)
    image = Image.fromarray(levels[0] if len(levels) == 1 else levels.transpose(1, 2, 0))
    image.save(path, **({"lossless": True} if name.endswith("webp") else {}))
    assert np.abs(checked(path).load() * 255 - levels).max() < 1e-4
    assert checked(path).gray == (len(picture) == 1)
    assert not checked(path).is_lossy


def test_a_webp_with_loss_is_told_as_such(tmp_path):
    save(tmp_path / "lossy.webp", COLOUR)
    assert checked(tmp_path / "lossy.webp").is_lossy


def test_an_opaque_alpha_channel_counts_as_none_and_that_is_said(tmp_path):
    folders(tmp_path, COLOUR, COLOUR)
    path = tmp_path / "captures" / "m" / "coffee.png"
    before = checked(path).load()
    Image.open(path).convert("RGBA").save(path)
    found = read_folders(tmp_path / "captures", tmp_path / "targets")
    assert (found.captures["m", "coffee"].load() == before).all()
    assert "opaque everywhere was left out: coffee.png" in " ".join(found.notes)
    image = Image.open(path)
    image.putpixel((5, 5), (9, 9, 9, 254))
    image.save(path)
    with pytest.raises(UserError, match="alpha that is not opaque everywhere"):
        checked(path)


def test_a_colour_profile_other_than_srgb_is_refused_as_in_datasets(tmp_path):
    folders(tmp_path, 0.9 * COLOUR, COLOUR)
    path = tmp_path / "captures" / "m" / "coffee.png"
    for space in ("sRGB", "LAB"):
        profile = ImageCms.ImageCmsProfile(ImageCms.createProfile(space)).tobytes()
        Image.open(path).save(path, icc_profile=profile)
        if space == "sRGB":
            assert checked(path).shape == (3, 48, 64)
    with pytest.raises(UserError, match=r"ICC colour profile is 'Lab.*convert it to sRGB: expected an 8-bit or 16-bit"):
        checked(path)


def test_a_raw_file_is_linear_light_above_black(tmp_path):
    pytest.importorskip("rawpy")
    light = np.random.default_rng(2).uniform(0, 1, (32, 48)).astype(np.float32)
    mosaic = np.full((64, 96), 512, np.uint16)
    mosaic[::2, ::2] += np.round(light * (16383 - 512)).astype(np.uint16)
    (tmp_path / "x.dng").write_bytes(bayer_dng(mosaic))
    picture = checked(tmp_path / "x.dng")
    assert picture.is_raw
    assert picture.shape == (3, 32, 48)
    assert np.abs(picture.load()[0] - light).max() < 1e-4
    assert np.abs(picture.load()[1:]).max() < 1e-6
