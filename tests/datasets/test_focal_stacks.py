"""Light fields: what moves in a view, by how much and which way, and that the light of a display moves as it does."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from torch import Tensor

from holobench_eval.core.errors import UserError
from holobench_eval.datasets import focal_stacks, shipped, still_life
from holobench_eval.datasets.defocus import blurred, defocus
from holobench_eval.datasets.focal_stacks import BLUR, FocalStacks
from holobench_eval.datasets.light_fields import PUPIL, LightFields
from holobench_eval.display import load_profile
from holobench_eval.display.simulated.changes import altered, kinds
from holobench_eval.display.simulated.pipeline import SimulatedBench

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


def test_the_blur_is_that_of_the_cone_which_the_iris_passes_and_a_disc_has_its_width():
    panel = load_profile("leto-aged").panel
    cone = panel.pupil * panel.wavelengths[1] / panel.pitch
    height = panel.region * panel.shape[0] * panel.pitch
    assert pytest.approx(1e-3 * cone / height, rel=1e-2) == BLUR
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


def test_an_item_tells_its_scene_and_plane_and_is_the_same_picture_on_a_larger_panel():
    stacks = FocalStacks(("shapes", "shapes-2"), (-1.5, 0.0))
    assert stacks.items() == ["shapes@-1.5mm", "shapes@0mm", "shapes-2@-1.5mm", "shapes-2@0mm"]
    assert (stacks.scene("shapes-2@-1.5mm"), stacks.plane("shapes-2@-1.5mm")) == ("shapes-2", -1.5)
    first, second = (stacks.load(f"{scene}@0mm", SHAPE) for scene in ("shapes", "shapes-2"))
    assert (first - second).abs().mean() > 0.05
    assert torch.equal(first, FocalStacks(planes=(0.0,)).load("shapes@0mm", SHAPE))
    small, large = (FocalStacks().load("shapes@0mm", shape) for shape in (SHAPE, (192, 192)))
    assert (torch.nn.functional.avg_pool2d(large, 2) - small).abs().mean() < 0.02


def test_a_scene_that_is_not_there_and_a_plane_without_any_of_it_are_refused(monkeypatch, tmp_path):
    monkeypatch.setattr(shipped, "files", lambda _: tmp_path)
    message = refused(FocalStacks(("motorcycle",)).items)
    assert "motorcycle_left.png and motorcycle_disp.npz not in the installed scikit-image" in message
    assert "install scikit-image 0.26.0" in message
    assert "nothing within 0.5 mm of the plane at 5 mm" in refused(FocalStacks(planes=(5.0,)).items)


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


def test_the_view_of_the_middle_is_the_picture_of_an_eye_with_that_pupil() -> None:
    (middle,) = LightFields(places=(0.0,)).items()
    stack = FocalStacks(planes=(0.0,), near=10, far=-10, blur=BLUR * PUPIL)
    assert torch.equal(LightFields(places=(0.0,)).load(middle, SHAPE), stack.load("shapes@0mm", SHAPE))
    assert PUPIL == kinds.PUPIL


@pytest.mark.parametrize("parallax", [-0.1, 0.06])
def test_every_point_of_a_scene_moves_by_its_depth_and_what_is_near_hides_what_is_far(parallax: float) -> None:
    still, height = 0.5, 200
    before, after = (still_life.still_life("shapes", (height, height), by, still) for by in (0.0, parallax))
    rows, columns = np.mgrid[:height, :height]
    nearness = before[1]
    seen = np.rint(columns - parallax * (nearness - still) * height).astype(int)
    inside = (seen >= 0) & (seen < height)
    there = after[1][rows[inside], seen[inside]]
    same = np.abs(there - nearness[inside]) < 0.02
    assert same.mean() > 0.9  # the rest is hidden now
    assert (there[~same] > nearness[inside][~same]).mean() > 0.8  # by what is nearer; others stand at edges
    colours = np.abs(after[0][rows[inside], seen[inside]] - before[0][inside])[same]
    assert np.median(colours) < 0.01


@pytest.mark.parametrize("place", [-0.5, 0.5])
def test_a_point_before_the_picture_moves_on_a_display_as_in_the_light_field(place: float) -> None:
    profile = load_profile("ideal")
    profile = replace(profile, panel=replace(profile.panel, wavelengths=(517e-9,)))
    spec = profile.spec((192, 192))
    away = 10 * spec.distance / profile.panel.distance  # mm nearer to the viewer, on this panel
    lens = focused(replace(spec, distance=spec.distance + away * 1e-3))
    shift = centroid(eye(profile, place).image(lens)) - centroid(eye(profile, 0.0).image(lens))
    height = spec.region.shape[0]
    assert shift == pytest.approx(-place * BLUR / 2 * 10 * height, rel=0.1)


def focused(spec) -> Tensor:
    """The phase ``(1, H, W)`` of a lens that gathers the light of the panel in its distance."""
    y, x = (torch.arange(n, dtype=torch.float64) - (n - 1) / 2 for n in spec.shape)
    squared = (y[:, None] ** 2 + x**2) * spec.pitch**2
    return (-torch.pi * squared / (spec.wavelengths[0] * spec.distance)).remainder(2 * torch.pi)[None].float()


def eye(profile, place: float) -> SimulatedBench:
    return SimulatedBench(altered(profile, "eye_pupil", f"{place:g}").scaled((192, 192)))


def centroid(image: Tensor) -> float:
    """Column in which the middle of the light lies [px]."""
    light = image[0].sum(0)
    return float((light * torch.arange(len(light))).sum() / light.sum())


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"scenes": ("motorcycle",)}, "scene 'motorcycle' has one view; allowed: shapes, shapes-2, shapes-3 ..."),
        ({"places": (0.5, 0.5000001)}, "place '0.5' is given twice"),
        ({"near": -10.0}, "near is to be larger than far"),
    ],
)
def test_what_has_no_views_is_refused(change, words: str) -> None:
    with pytest.raises(Exception, match="^" + words.replace(".", r"\.")):
        LightFields(**change)
