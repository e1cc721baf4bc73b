from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from skimage import data, io

from holobench_eval.core.errors import CellError
from holobench_eval.imaging import FiducialGrid, Registration, Warp, fiducial, register
from holobench_eval.imaging.cross_check import disagreement, second_warp
from holobench_eval.testing.grid_poses import corner_points, photograph, random_pose
from tests.support.benches.simulated_grid import Pose, capture, pose, random

SHAPE = (160, 160)
SENSOR = (360, 360)


@pytest.fixture(scope="module")
def grid() -> FiducialGrid:
    return fiducial(SHAPE)


def corner_error(found: Registration, where: Pose, channel: int = 0) -> float:
    """Mean distance [region px] between where the corners of the region are and where they are said to be."""
    height, width = where.shape
    corners = np.array([[0.0, 0.0], [width - 1, 0.0], [0.0, height - 1], [width - 1, height - 1]])
    told = where.to_region(found.warps[channel].to_sensor(corners))
    return float(np.linalg.norm(told - corners, axis=1).mean())


def registered(grid: FiducialGrid, where: Pose, sensor: tuple[int, int], draw: np.random.Generator, **seen):
    frame = capture(grid.image.numpy().astype(np.float64), where, sensor, draw, **seen)
    return register(torch.from_numpy(frame)[None], grid)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("quarter_turns", range(4))
def test_a_clean_capture_is_registered_to_a_twentieth_of_a_pixel_in_all_eight_orientations(quarter_turns, mirrored):
    shape, sensor = (128, 208), (440, 440)
    draw = random("clean", shape, quarter_turns, mirrored)
    where = pose(draw, shape, sensor, quarter_turns=quarter_turns, mirrored=mirrored)
    found = registered(fiducial(shape), where, sensor, draw, contrast=0.0, uneven=False)
    assert corner_error(found, where) < 0.05
    assert found.residual[0] < 0.06


def test_uneven_light_and_stray_light_do_not_pull_the_grid(grid):
    errors = []
    for index in range(6):
        draw = random("uneven", index)
        where = pose(draw, SHAPE, SENSOR)
        found = registered(grid, where, SENSOR, draw, contrast=0.0, background=0.1, outside=0.1)
        errors.append(corner_error(found, where))
    assert max(errors) < 0.05


@pytest.mark.parametrize(("contrast", "median", "largest"), [(0.7, 0.12, 0.25), (1.0, 0.18, 0.35)])
def test_speckle_leaves_a_fraction_of_a_pixel(grid, contrast, median, largest):
    errors, residuals = [], []
    for index in range(5):
        draw = random("speckle", contrast, index)
        where = pose(draw, SHAPE, SENSOR)
        found = registered(grid, where, SENSOR, draw, contrast=contrast, background=0.1 * (index % 2))
        errors.append(corner_error(found, where))
        residuals.append(found.residual[0])
    assert np.median(errors) < median
    assert max(errors) < largest
    assert max(residuals) < 0.3


def test_a_distortion_is_fitted_where_there_is_one_and_left_out_where_there_is_none(grid):
    bend = random("bend").normal(size=(6, 2)) * 0.4
    bend[:3] = 0
    for amount in (bend, 0 * bend):
        draw = random("distortion")
        where = pose(draw, SHAPE, SENSOR, bend=amount)
        found = registered(grid, where, SENSOR, draw, contrast=0.0)
        assert bool(found.warps[0].quadratic.any()) == bool(amount.any())
        assert corner_error(found, where) < 0.06


def test_a_distortion_is_fitted_in_speckle_too(grid):
    bend = random("bend").normal(size=(6, 2)) * 0.8
    bend[:3] = 0
    draw = random("distortion in speckle")
    where = pose(draw, SHAPE, SENSOR, bend=bend)
    found = registered(grid, where, SENSOR, draw, contrast=0.7)
    assert found.warps[0].quadratic.any()
    assert corner_error(found, where) < 0.5


def test_uneven_light_is_not_taken_for_a_distortion():
    """One of forty draws in which the F-test alone, at one in a thousand, sees a distortion in speckle and fringes."""
    shape, sensor = (400, 400), (960, 960)
    draw = random("no distortion", 31)
    where = pose(draw, shape, sensor)
    found = registered(fiducial(shape), where, sensor, draw, contrast=0.7, background=0.1)
    assert not found.warps[0].quadratic.any()
    assert corner_error(found, where) < 0.15


def test_every_channel_has_its_own_warp_and_rectify_undoes_it(grid):
    picture = data.astronaut()[:320, 100:420].reshape(160, 2, 160, 2, 3).mean(axis=(1, 3)) / 255
    picture = cv2.GaussianBlur(picture, (0, 0), 1.0)
    frames, grids, poses = [], [], []
    for channel in range(3):
        draw = random("colour", channel)
        where = pose(draw, SHAPE, SENSOR, quarter_turns=1, mirrored=True)
        clean = {"contrast": 0.0, "uneven": False, "noise": 0.0}
        grids.append(capture(grid.image.numpy().astype(np.float64), where, SENSOR, draw, **clean))
        frames.append(capture(picture[..., channel], where, SENSOR, draw, **clean))
        poses.append(where)
    found = register(torch.from_numpy(np.stack(grids)), grid)
    assert max(corner_error(found, where, channel) for channel, where in enumerate(poses)) < 0.05
    with pytest.raises(CellError, match="3 channels"):
        found.rectify(torch.zeros(1, *SENSOR))
    region = found.rectify(torch.from_numpy(np.stack(frames)))
    assert region.shape == (3, *SHAPE)
    inner = np.s_[:, 4:-4, 4:-4]
    assert float(np.abs(region.numpy() - picture.transpose(2, 0, 1))[inner].mean()) < 0.004


def test_one_channel_without_a_grid_refuses_all(grid):
    draw = random("one channel")
    frame = capture(grid.image.numpy(), pose(draw, SHAPE, SENSOR), SENSOR, draw, contrast=0.0)
    noise = random("noise").exponential(size=SENSOR).astype(np.float32)
    with pytest.raises(CellError, match="channel 1"):
        register(torch.from_numpy(np.stack([frame, noise, frame])), grid)


# Others are refused in tests/testing: photographs, speckle, checkerboards, grids without their marks or half outside.
def test_captures_that_cannot_be_or_leave_too_much_are_refused(grid):
    draw = random("bound")
    frame = capture(grid.image.numpy(), pose(draw, SHAPE, SENSOR), SENSOR, draw, contrast=1.0)
    with pytest.raises(CellError, match=r"leaves 0\.\d+ px RMS, more than the bound of 0.05 px"):
        register(torch.from_numpy(frame)[None], grid, bound=0.05)
    with pytest.raises(CellError, match=r"registration of channel 0: no grid[^\n]*$"):
        register(torch.zeros(1, *SENSOR), grid)
    with pytest.raises(CellError, match="finite"):
        register(torch.full((1, *SENSOR), float("nan")), grid)
    with pytest.raises(CellError, match="shape"):
        register(torch.zeros(SENSOR), grid)


REAL = Path(__file__).parents[3] / "shared" / "captures" / "stanford-2021"


def wrong(pose, pixels: float) -> Warp:
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


def test_it_has_no_opinion_on_another_picture_and_disagreement_is_in_region_pixels_at_the_worst_corner():
    pose = random_pose(2)
    frame = photograph(pose, scene(pose.shape))
    assert second_warp(frame, fiducial(pose.shape).image.numpy(), wrong(pose, 0.0)) is None
    assert second_warp(frame, np.ascontiguousarray(scene(pose.shape)[:, ::-1]), wrong(pose, 0.0)) is None
    assert second_warp(np.zeros_like(frame), scene(pose.shape), wrong(pose, 0.0)) is None
    with pytest.raises(ValueError, match="one shape"):
        second_warp(frame, np.zeros((8, 8), np.float32), wrong(pose, 0.0))
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
