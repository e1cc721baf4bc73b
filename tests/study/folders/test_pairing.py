"""What of a capture is compared with its target: nothing is lost, nothing is guessed, and everything is said."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image, ImageCms

from holobench_eval.core.errors import UserError
from holobench_eval.imaging.warp import Warp
from holobench_eval.study.folders.exposure import FEWEST_LEVELS, levels, refusal, within
from holobench_eval.study.folders.files import Folders, read_folders
from holobench_eval.study.folders.pairing import exchange
from holobench_eval.study.folders.pictures import checked
from holobench_eval.study.folders.visible import cropped, largest_part, share, shown
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
    assert re.search(f"Scored on the {name} channel alone.*m/coffee", " ".join(found.notes))


@pytest.mark.parametrize(
    ("target", "note"),
    [
        (COLOUR, ""),
        (EQUAL, ""),
        (np.concatenate([GRAY, 0 * GRAY, 0 * GRAY]), "coffee has light in red alone."),
        (np.concatenate([0 * GRAY, GRAY, GRAY]), "coffee has light in green and blue alone."),
    ],
)
def test_pictures_in_colour_are_compared_in_colour(tmp_path, target, note):
    found = folders(tmp_path, (target * [[[0.9]], [[0.5]], [[0.7]]]).astype(np.float32), target)
    assert (found.pairings["m", "coffee"].channel, found.pairings["m", "coffee"].refused) == ("", "")
    said = f"Scored in three colours, where light that the target has not is an error: {note}"
    assert list(found.notes) == [said] * bool(note)


@pytest.mark.parametrize(("capture", "target"), [(0.9 * EQUAL, GRAY), (0.9 * GRAY, EQUAL)])
def test_equal_channels_are_gray_and_that_is_said(tmp_path, capture, target):
    found = folders(tmp_path, capture, target)
    assert found.pairings["m", "coffee"].channel == "gray"
    assert "Scored in gray, since the channels of the capture, or of its target, are equal: m/coffee" in found.notes[0]


def nearly_gray() -> Picture:
    """A gray picture in colour, the channels apart by one level or two."""
    apart = np.random.default_rng(6).integers(0, 3, EQUAL.shape)
    return ((np.round(EQUAL * 240) + apart) / 255).astype(np.float32)


NEARLY = "whose channels differ by a few levels of 255"
AS_SHOWN = "save the target as it was shown"


@pytest.mark.parametrize(
    ("capture", "target", "words"),
    [
        (COLOUR, GRAY, ("in colour and the target gray", "save the")),
        (laser(1, leak=0.6), GRAY, ("1.00 in green", "save the")),
        (GRAY, COLOUR, ("gray and the target is in colour", "save the")),
        (0.9 * EQUAL, COLOUR, ("the capture is gray and the target is in colour",)),
        (laser(0), COLOUR, ("light in its red channel alone and the target is in colour",)),
        (nearly_gray(), GRAY, (f"the target is gray and the capture nearly so, {NEARLY}", "save the capture in gray")),
        (0.9 * GRAY, nearly_gray(), (f"the capture is gray and the target is nearly gray, {NEARLY}", AS_SHOWN)),
        (laser(0), nearly_gray(), (f"in its red channel alone and the target is nearly gray, {NEARLY}", AS_SHOWN)),
    ],
)
def test_what_would_be_a_guess_is_refused_with_its_remedy(tmp_path, capture, target, words):
    refused = folders(tmp_path, capture.astype(np.float32), target).pairings["m", "coffee"].refused
    assert [word for word in words if word not in refused] == []


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


def dark_with_hot_pixels() -> Picture:
    """Four levels, and 0.3 % of the pixels hot, each as bright as it likes."""
    draw = np.random.default_rng(3)
    capture = np.round(np.kron(EQUAL, np.ones((8, 8))) * 3) / 255
    hot = draw.random(capture.shape[1:]) < 0.003
    capture[:, hot] = draw.uniform(0.1, 1, hot.sum())
    return capture.astype(np.float32)


def red_of_few_levels() -> Picture:
    """As a colour camera sees the light of one laser, which is red."""
    capture = np.random.default_rng(4).integers(0, 12, EQUAL.shape).astype(np.float32) / 255
    capture[0] = np.round(EQUAL[0] * 3) * 40 / 255
    return capture


@pytest.mark.parametrize(
    ("capture", "target", "what"),
    [
        (np.round(EQUAL * 3) / 3, GRAY, "it has 4 levels"),  # stretched
        (dark_with_hot_pixels(), GRAY, "it has 4 levels"),
        (red_of_few_levels(), GRAY, "it has 4 levels"),
        (np.concatenate([np.round(0.9 * COLOUR[:1] * 4) / 255, 0.9 * COLOUR[1:]]), COLOUR, "its red channel has"),
    ],
    ids=["stretched", "hot pixels", "of the single laser", "of a channel that the target has light in"],
)
def test_few_levels_are_few_with_an_offset_a_stretch_or_hot_pixels_and_in_one_channel(tmp_path, capture, target, what):
    refused = folders(tmp_path, capture.astype(np.float32), target).pairings["m", "coffee"].refused
    assert f"under-exposed: {what}" in refused


@pytest.mark.parametrize("capture", [EQUAL, EQUAL * 20 / 255])
def test_a_dark_capture_of_enough_levels_is_no_fault(tmp_path, capture):
    assert folders(tmp_path, capture, GRAY).pairings["m", "coffee"].refused == ""


@pytest.mark.parametrize(("brightness", "is_refused"), [(0.8, False), (0.05, True)])
def test_a_bright_capture_of_few_levels_is_no_fault_of_a_black_and_white_target_alone(tmp_path, brightness, is_refused):
    two = (EQUAL > 0.5).astype(np.float32)
    assert bool(folders(tmp_path / "two", brightness * two, two[:1]).pairings["m", "coffee"].refused) == is_refused
    assert "it has 2 levels" in folders(tmp_path / "many", brightness * two, GRAY).pairings["m", "coffee"].refused


@pytest.mark.parametrize("scene", [np.s_[:, 100:116, 200:220], np.s_[:, 100, 50:250]])
def test_a_scene_that_is_nearly_all_black_is_judged_by_what_is_bright_in_it(tmp_path, scene):
    black = np.zeros((1, 300, 400), dtype=np.float32)
    black[scene] = photograph("coffee", (300, 400))[:1][scene]
    assert (black > 0).mean() < 0.01
    noise = np.abs(np.random.default_rng(5).normal(0, 0.6, black.shape)) / 255
    seen = np.clip(0.9 * black + noise, 0, 1)
    assert folders(tmp_path / "fair", seen, black).pairings["m", "coffee"].refused == ""
    dim = np.clip(0.02 * black + noise, 0, 1)
    assert "under-exposed" in folders(tmp_path / "dim", dim, black).pairings["m", "coffee"].refused


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
    with pytest.raises(UserError, match=r"ICC colour profile is 'Lab.*convert it to sRGB; expected an 8-bit or 16-bit"):
        checked(path)


def test_a_raw_file_is_linear_light_above_black(tmp_path):
    pytest.importorskip("rawpy")
    light = np.random.default_rng(2).uniform(0, 1, (32, 48)).astype(np.float32)
    mosaic = np.full((64, 96), 512, np.uint16)
    mosaic[::2, ::2] += np.round(light * (16383 - 512)).astype(np.uint16)
    (tmp_path / "x.dng").write_bytes(bayer_dng(mosaic))
    picture = checked(tmp_path / "x.dng")
    assert picture.is_linear
    assert picture.shape == (3, 32, 48)
    assert np.abs(picture.load()[0] - light).max() < 1e-4
    assert np.abs(picture.load()[1:]).max() < 1e-6


def test_a_lamp_beside_the_target_adds_no_levels():
    frame = np.zeros((120, 160), np.float32)
    frame[30:90, 40:120] = np.round(cv2.resize(GRAY[0], (80, 60)) * 4) / 255
    cv2.circle(frame, (12, 12), 8, 1.0, -1)
    frame = np.maximum(frame, cv2.GaussianBlur(frame, (0, 0), 3) * (np.arange(160) < 30)).astype(np.float32)
    shift = np.array([[1.0, 0, 40], [0, 1, 30], [0, 0, 1]])
    seen = within(frame, Warp((60, 80), shift, np.zeros((6, 2))))
    assert levels(frame).any > FEWEST_LEVELS >= seen.any
    shown = levels(cv2.resize(GRAY[0], (80, 60)))
    assert "under-exposed: it has" in refusal([("", seen, shown)], aligned=True)


@settings(max_examples=25, deadline=None)
@given(
    gains=st.tuples(*[st.floats(0.1, 10)] * 3), leak=st.floats(0, 0.3), haze=st.floats(0, 0.2), speckle=st.floats(0, 1)
)
def test_exchanged_colours_are_told_from_right_ones_whatever_their_brightness(gains, leak, haze, speckle):
    target = torch.from_numpy(photograph("coffee", (120, 150)))
    grain = 1 + speckle * (2 * torch.rand(target.shape, generator=torch.Generator().manual_seed(0)) - 1)
    seen = (target + leak * target.mean(0) + haze) * grain * torch.tensor(gains)[:, None, None]
    assert exchange(seen, target) == ""
    assert exchange(seen.flip(0), target) == exchange(seen, target.flip(0)) != ""
    gray = target.mean(0).expand(3, -1, -1)
    other = torch.from_numpy(photograph("rocket", (120, 150)))
    assert exchange(seen, other) == exchange(seen.flip(0), other) == ""  # another picture has no order of colours
    assert exchange(seen, gray) == exchange(gray, target) == exchange(seen[:1], target[:1]) == ""


RED = np.stack([COLOUR[0], 0 * COLOUR[0], 0 * COLOUR[0]])
LEAKS = {  # into blue, of what red sites see
    "none": lambda red: 0 * red,
    "in proportion": lambda red: 0.075 * red,
    "less a threshold": lambda red: (0.05 * red - 0.003).clip(0),
    "with a curve": lambda red: 0.075 * red**1.3,
    "and noise": lambda red: 0.02 * red + 0.01 * np.random.default_rng(2).random(red.shape),
}


@pytest.mark.parametrize("lit", [0, 1, 2])
@pytest.mark.parametrize("kind", LEAKS)
def test_a_leak_into_a_colour_that_the_target_has_not_is_no_exchange_and_an_exchange_is(kind, lit):
    target = torch.from_numpy(np.roll(RED, lit, axis=0))
    seen = RED[0] * (1 + 0.2 * np.random.default_rng(1).standard_normal(RED[0].shape)).clip(0)
    planes = torch.from_numpy(np.roll(np.stack([seen, 2 * LEAKS[kind](seen), LEAKS[kind](seen)]), lit, axis=0))
    assert exchange(planes, target) == ""
    assert (exchange(planes.flip(0), target) != "") == (lit != 1)  # green stays where it is


POSES = [
    lambda seen: seen.transpose(1, 2),
    lambda seen: seen.flip(1),
    lambda seen: seen.flip(2),
    lambda seen: seen.rot90(1, (1, 2)),
]


@pytest.mark.parametrize("pose", range(4))
@pytest.mark.parametrize("name", ["colorwheel", "retina", "astronaut", "hubble_deep_field"])
def test_a_capture_in_another_pose_is_not_called_exchanged(name, pose):
    target = torch.from_numpy(photograph(name, (128, 128)))
    assert exchange(POSES[pose](target), target) == ""
    assert exchange(target.flip(0), target) != ""


def moved(x: float, y: float, shape: tuple[int, int] = (40, 60)) -> Warp:
    return Warp(shape, np.array([[2.0, 0, x], [0, 2, y], [0, 0, 1]]), np.zeros((6, 2)))


def test_a_target_on_the_capture_or_two_pixels_beyond_is_shown_whole():
    assert shown(moved(0, 0), (100, 140)).all()
    assert shown(moved(-4, 0), (100, 140)).all()
    assert not shown(moved(-5, 0), (100, 140)).all()


def test_what_lies_beyond_two_sides_is_left_out_to_the_pixel():
    mask = shown(moved(-20, -11), (60, 140))
    part = largest_part(mask)
    assert part == (6, 36, 10, 60)
    assert share(part, mask.shape) == 30 * 50 / (40 * 60)
    assert mask[6:36, 10:60].all()


def test_a_turned_border_leaves_a_rectangle_that_is_shown_everywhere():
    y, x = np.mgrid[:80, :100]
    mask = x > 20 + 0.2 * y
    part = largest_part(mask)
    assert mask[part[0] : part[1], part[2] : part[3]].all()
    assert share(part, mask.shape) > 0.6
    assert share(largest_part(np.zeros((40, 60), dtype=bool)), (40, 60)) == 0


def test_the_map_of_a_part_leads_to_the_same_places():
    part = cropped(moved(3, 7), (6, 36, 10, 60))
    assert part.shape == (30, 50)
    assert np.allclose(part.corners()[0], moved(3, 7).to_sensor(np.array([[10.0, 6.0]]))[0])
