from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from skimage import data, io

from holobench_eval.imaging import Warp, fiducial
from holobench_eval.imaging.cross_check import disagreement, second_warp
from holobench_eval.testing.grid_poses import Pose, corner_points, photograph, random_pose

REAL = Path(__file__).parents[3] / "shared" / "captures" / "stanford-2021"


def wrong(pose: Pose, pixels: float) -> Warp:
    """The pose's warp, its corners moved by up to ``pixels`` region pixels."""
    corners = corner_points(pose.shape)
    moves = np.random.default_rng(pose.number).normal(size=(4, 2))
    moves *= pixels / np.linalg.norm(moves, axis=1).max()
    moved = cv2.getPerspectiveTransform(corners.astype(np.float32), (corners + moves).astype(np.float32))
    return Warp(pose.shape, pose.homography @ moved, np.zeros((6, 2)))


def scene(shape: tuple[int, int]) -> np.ndarray:
    linear = (data.astronaut()[..., 1] / 255) ** 2.2
    return cv2.resize(linear, shape[::-1], interpolation=cv2.INTER_AREA).astype(np.float32)


def psnr(frame: np.ndarray, warp: Warp, target: np.ndarray) -> float:
    image = np.maximum(warp.sample(frame), 0)
    image = np.clip(image * (image * target).sum() / (image * image).sum(), 0, 1)
    return float(-10 * np.log10(np.mean((image - target) ** 2)))


@pytest.mark.parametrize("contrast", [0.5, 1.0])
def test_it_finds_the_grid_where_it_is_whatever_the_first_one_says(contrast):
    apart = []
    for number in (1, 6):
        pose = replace(random_pose(number), contrast=contrast)
        frame, grid = photograph(pose), fiducial(pose.shape).image.numpy()
        for pixels in (0.2, 5.0):
            first = wrong(pose, pixels)
            second = second_warp(frame, grid, first)
            assert disagreement(first, second) == pytest.approx(pixels, abs=0.8)
            apart.append(pose.corner_error(second.corners()))
    assert np.median(apart) < 0.4
    assert max(apart) < 0.8


@pytest.mark.parametrize(("number", "contrast"), [(1, 0.4), (6, 1.0)])
def test_a_photograph_scores_the_same_through_it_as_through_the_truth(number, contrast):
    pose = replace(random_pose(number), contrast=contrast)
    target = scene(pose.shape)
    frame = photograph(pose, target)
    second = second_warp(frame, target, wrong(pose, 3.0))
    assert psnr(frame, second, target) == pytest.approx(psnr(frame, wrong(pose, 0.0), target), abs=0.2)


def test_it_fits_a_distortion_of_its_own_where_the_first_has_one():
    pose = replace(random_pose(3, (160, 160)), contrast=0.2)
    grid = fiducial(pose.shape).image.numpy()
    bend = np.zeros((6, 2))
    bend[3:] = [[1.2, 0.0], [0.0, 0.8], [-0.5, 1.0]]
    bent = replace(wrong(pose, 0.0), quadratic=bend)
    x, y = np.meshgrid(np.arange(160.0), np.arange(160.0))
    points = np.stack([x, y], axis=-1).reshape(-1, 2)
    sensor = bent.to_sensor(points).reshape(160, 160, 2)
    straight = cv2.perspectiveTransform(sensor, np.linalg.inv(pose.homography)).astype(np.float32)
    back = (2 * np.stack([x, y], axis=-1) - straight).astype(np.float32)
    frame = photograph(pose, cv2.remap(grid, back, None, cv2.INTER_CUBIC))
    second = second_warp(frame, grid, replace(bent, quadratic=0.7 * bend))
    assert disagreement(bent, second) < 0.5
    assert disagreement(bent, wrong(pose, 0.0)) > 1.5


def test_it_has_no_opinion_on_another_picture():
    pose = random_pose(2)
    frame = photograph(pose, scene(pose.shape))
    assert second_warp(frame, fiducial(pose.shape).image.numpy(), wrong(pose, 0.0)) is None
    assert second_warp(frame, np.ascontiguousarray(scene(pose.shape)[:, ::-1]), wrong(pose, 0.0)) is None
    assert second_warp(np.zeros_like(frame), scene(pose.shape), wrong(pose, 0.0)) is None


def test_a_reference_of_another_shape_is_refused():
    pose = random_pose(2)
    with pytest.raises(ValueError, match="one shape"):
        second_warp(photograph(pose), np.zeros((8, 8), np.float32), wrong(pose, 0.0))


def test_disagreement_is_in_region_pixels_at_the_worst_corner():
    first = Warp((100, 200), np.diag([2.0, 2.0, 1.0]), np.zeros((6, 2)))
    second = Warp((100, 200), np.array([[2.0, 0, 6], [0, 2, 8], [0, 0, 1]]), np.zeros((6, 2)))
    assert disagreement(first, first) == 0
    assert disagreement(first, second) == pytest.approx(5)


@pytest.mark.skipif(not REAL.is_dir(), reason="the real captures are not beside the repository")
@pytest.mark.parametrize("name", ["citl-asm", "sgd-ours"])
def test_on_real_captures_it_finds_the_stated_crop(name):
    target = (io.imread(REAL / "target.png")[..., :3].mean(axis=-1) / 255) ** 2.2
    frame = (io.imread(REAL / f"{name}.png")[..., :3].mean(axis=-1) / 255) ** 2.2
    crop = np.array([[1.2, 0, 360.1], [0, 1.2, 0.1], [0, 0, 1]])
    moved = crop @ np.array([[1, 0, 4], [0, 1, -3], [0, 0, 1]])
    first = Warp((800, 800), moved, np.zeros((6, 2)))
    second = second_warp(frame.astype(np.float32), target.astype(np.float32), first)
    assert disagreement(Warp((800, 800), crop, np.zeros((6, 2))), second) < 0.5
