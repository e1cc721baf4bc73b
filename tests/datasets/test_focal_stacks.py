from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from torch import Tensor

from holobench_eval.core.errors import UserError
from holobench_eval.datasets import focal_stacks, shipped
from holobench_eval.datasets.defocus import blurred, defocus
from holobench_eval.datasets.focal_stacks import BLUR, FocalStacks
from holobench_eval.display import load_profile

SHAPE = (96, 96)


def detail(picture: Tensor, mask: Tensor) -> float:
    """Mean squared difference of neighbours within a mask."""
    both = mask[:, 1:] & mask[:, :-1]
    return float((picture[:, :, 1:] - picture[:, :, :-1]).square()[:, both].mean())


def refused(act) -> str:
    with pytest.raises(UserError) as caught:
        act()
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("scene", ["shapes", "motorcycle"])
def test_what_is_in_focus_is_as_sharp_as_the_scene_and_the_rest_is_not(scene):
    planes = (-1.5, 1.5)
    stacks, everywhere = (FocalStacks((scene,), planes, blur=blur) for blur in (4 * BLUR, 1e-6))
    for item in stacks.items():
        mask = stacks.mask(item, SHAPE)
        seen, sharp = stacks.load(item, SHAPE), everywhere.load(item, SHAPE)
        difference = (seen - sharp).abs().mean(0)
        assert difference[mask].mean() < 0.3 * difference[~mask].mean()
        assert detail(seen, ~mask) < 0.2 * detail(sharp, ~mask)


def test_blur_grows_with_the_distance_from_the_plane():
    planes = (-2.0, -1.0, 0.0, 1.0, 2.0)
    stacks = FocalStacks(("shapes",), planes, blur=3 * BLUR)
    for end, order in (("shapes@-2mm", planes), ("shapes@2mm", planes[::-1])):
        mask = stacks.mask(end, SHAPE)
        found = [detail(stacks.load(f"shapes@{plane:g}mm", SHAPE), mask) for plane in order]
        assert found == sorted(found, reverse=True)
        assert found[-1] < 0.5 * found[0]


def test_the_blur_is_that_of_the_cone_which_the_iris_passes():
    panel = load_profile("leto-aged").panel
    cone = panel.pupil * panel.wavelengths[1] / panel.pitch
    height = panel.region * panel.shape[0] * panel.pitch
    assert pytest.approx(1e-3 * cone / height, rel=1e-2) == BLUR


def test_a_disc_has_the_width_asked_for():
    point = np.zeros((41, 41, 1), np.float32)
    point[20, 20] = 1
    for radius in (2.0, 5.5, 9.0):
        disc = blurred(point, radius)[..., 0]
        assert disc.sum() == pytest.approx(1, abs=1e-5)
        variance = (disc * (np.arange(41) - 20) ** 2).sum()
        assert variance == pytest.approx(radius**2 / 4, abs=0.2)  # the soft edge adds 1/6


def test_no_light_bleeds_over_the_edge_of_a_thing_in_focus():
    y, x = np.ogrid[:64, :64]
    disc = np.hypot(y - 32, x - 32) < 14
    image = np.where(disc, 0.9, 0.2)[..., None].astype(np.float32)
    shown = defocus(image, disc.astype(int), [6.0, 0.0])
    assert np.allclose(shown, image, atol=1e-4)


def test_a_blurred_thing_in_front_bares_what_is_behind_its_edge():
    image = np.full((64, 64, 1), 0.2, np.float32)
    image[:, 32:] = 0.9
    layers = np.zeros((64, 64), int)
    layers[:, 32:] = 1
    line = defocus(image, layers, [0.0, 6.0])[32, :, 0]
    assert np.allclose(line[:25], 0.2, atol=1e-4)
    assert np.allclose(line[40:], 0.9, atol=1e-4)
    assert 0.4 < line[31:33].mean() < 0.7
    assert np.all(np.diff(line) > -1e-4)


def test_a_slope_has_no_seams_between_its_layers():
    image = np.full((64, 64, 1), 0.9, np.float32)
    image[:, :4] = 0.0
    layers = np.tile(np.arange(64) // 4, (64, 1))
    shown = defocus(image, layers, [6.0] * 16)
    assert shown[:, 12:].min() > 0.895


def test_a_stack_is_the_same_picture_on_a_larger_panel():
    small, large = (FocalStacks().load("shapes@0mm", shape) for shape in (SHAPE, (192, 192)))
    assert (torch.nn.functional.avg_pool2d(large, 2) - small).abs().mean() < 0.02


def test_an_item_tells_its_scene_and_its_plane_and_scenes_differ_by_their_number_alone():
    stacks = FocalStacks(("shapes", "shapes-2"), (-1.5, 0.0))
    assert stacks.items() == ["shapes@-1.5mm", "shapes@0mm", "shapes-2@-1.5mm", "shapes-2@0mm"]
    assert (stacks.scene("shapes-2@-1.5mm"), stacks.plane("shapes-2@-1.5mm")) == ("shapes-2", -1.5)
    first, second = (stacks.load(f"{scene}@0mm", SHAPE) for scene in ("shapes", "shapes-2"))
    assert (first - second).abs().mean() > 0.05
    assert torch.equal(first, FocalStacks(planes=(0.0,)).load("shapes@0mm", SHAPE))


def test_a_plane_where_nothing_is_in_focus_is_refused():
    assert "nothing within 0.5 mm of the plane at 5 mm" in refused(FocalStacks(planes=(5.0,)).items)


def test_a_motorcycle_that_is_not_there_is_said_to_be_missing(monkeypatch, tmp_path):
    monkeypatch.setattr(shipped, "files", lambda _: tmp_path)
    message = refused(FocalStacks(("motorcycle",)).items)
    assert "motorcycle_left.png and motorcycle_disp.npz not in the installed scikit-image" in message
    assert "install scikit-image 0.26.0" in message


def test_holes_of_a_disparity_map_belong_to_the_background():
    rows = np.array([[5.0, np.inf, np.inf, 2.0], [np.inf, 3.0, np.inf, np.inf], [np.inf] * 4])
    filled = focal_stacks._without_holes(rows)
    assert filled.tolist() == [[5, 2, 2, 2], [3, 3, 3, 3], [2, 2, 2, 2]]


def write_scene(folder: Path, depth: np.ndarray) -> FocalStacks:
    folder.mkdir(exist_ok=True)
    draw = np.random.default_rng(1)
    cv2.imwrite(str(folder / "image.png"), draw.integers(0, 256, (60, 80, 3), dtype=np.uint8))
    cv2.imwrite(str(folder / "depth.png"), depth)
    return FocalStacks((str(folder),), (-2.0, 2.0), blur=4 * BLUR)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_a_folder_with_an_image_and_its_depth_is_a_scene(tmp_path, kind):
    depth = np.zeros((60, 80), kind)
    depth[:, 40:] = np.iinfo(kind).max // 2  # bright is near, whatever the range that is used
    stacks = write_scene(tmp_path / "room", depth)
    assert stacks.items() == ["room@-2mm", "room@2mm"]
    far, near = (stacks.mask(item, (60, 80)) for item in stacks.items())
    assert far[:, :38].all()
    assert not far[:, 42:].any()
    assert near[:, 42:].all()
    seen = stacks.load("room@2mm", (60, 80))
    assert detail(seen, near) > 5 * detail(seen, ~near)
    before = stacks.digest("room@2mm")
    depth[:, 30:] = np.iinfo(kind).max
    assert write_scene(tmp_path / "room", depth).digest("room@2mm") != before


@pytest.mark.parametrize(
    ("depth", "words"),
    [
        (np.zeros((60, 80), np.uint8), "its depth is the same everywhere"),
        (np.eye(60, dtype=np.uint8), "image and depth are 80 x 60 and 60 x 60 pixels"),
        (np.zeros((60, 80, 3), np.uint8), "depth.png: expected a gray PNG of 8 or 16 bits"),
    ],
)
def test_a_folder_whose_depth_cannot_be_used_is_refused(tmp_path, depth, words):
    assert words in refused(write_scene(tmp_path / "room", depth).items)
