"""The fiducial grid: where its circles are, how they are measured, drawn and mapped."""

import math

import cv2
import numpy as np
import pytest
import torch
from torch.nn import functional

from holobench_eval.core.errors import UserError
from holobench_eval.imaging import fiducial, register, subpixel
from holobench_eval.imaging.grid_picture import BORDER, CIRCLE, MARK, grid_picture
from holobench_eval.imaging.shifts import correlate, correlate_each
from holobench_eval.imaging.warp import Warp, remap
from holobench_eval.testing.grid_poses import photograph, random_pose

SHAPES = [(96, 96), (160, 160), (160, 288), (300, 200), (1080, 1920)]


@pytest.mark.parametrize("shape", SHAPES)
def test_circles_lie_where_the_centres_say(shape):
    grid = fiducial(shape)
    image = grid.image.numpy().astype(np.float64)
    reach = int(grid.spacing / 2)
    for x, y in grid.centres[:: max(1, len(grid.centres) // 20)]:
        row, column = round(y), round(x)
        patch = image[row - reach : row + reach + 1, column - reach : column + reach + 1]
        down, across = np.mgrid[row - reach : row + reach + 1, column - reach : column + reach + 1]
        assert (patch * across).sum() / patch.sum() == pytest.approx(x, abs=0.01)
        assert (patch * down).sum() / patch.sum() == pytest.approx(y, abs=0.01)


@pytest.mark.parametrize("shape", SHAPES)
def test_the_lattice_is_square_and_centred_and_discs_have_the_light_of_their_radii(shape):
    grid = fiducial(shape)
    assert grid.spacing == pytest.approx(max(16, 18 * (min(shape) / 160) ** 0.75))
    lattice = grid.centres.reshape(grid.rows, grid.columns, 2)
    assert np.allclose(np.diff(lattice, axis=1), [grid.spacing, 0])
    assert np.allclose(np.diff(lattice, axis=0), [0, grid.spacing])
    assert np.allclose(lattice.mean(axis=(0, 1)), [(shape[1] - 1) / 2, (shape[0] - 1) / 2])
    margin = lattice[0, 0] / grid.spacing
    assert ((margin >= 0.7) & (margin < 1.2)).all()
    assert (grid.radius, grid.mark_radius) == pytest.approx((0.28 * grid.spacing, 0.39 * grid.spacing))
    areas = math.pi * np.where(grid.marks, grid.mark_radius, grid.radius) ** 2
    assert float(grid.image.sum()) == pytest.approx(areas.sum(), rel=0.02)
    column, row = np.round(grid.centres[0]).astype(int)
    x, y = column - grid.centres[0, 0] + np.arange(9), row - grid.centres[0, 1]
    edge = np.clip((grid.mark_radius - np.hypot(x, y)) / 2 + 0.5, 0, 1)  # two pixels wide
    assert grid.image[row, column : column + 9].numpy() == pytest.approx(edge, abs=1e-6)
    assert grid.image.shape == shape == grid.shape
    assert grid.image.dtype == torch.float32
    assert float(grid.image.min()) == 0.0
    assert float(grid.image.max()) == 1.0
    border = torch.ones(shape, dtype=torch.bool)
    border[4:-4, 4:-4] = False
    assert float(grid.image[border].max()) == 0.0


def test_the_marks_draw_an_f_and_a_region_too_small_for_a_grid_is_refused():
    grid = fiducial((160, 160))
    rows = ["".join(" x"[int(mark)] for mark in row).rstrip() for row in grid.marks.reshape(8, 8)]
    assert rows == ["xxxxxx", "x", "x", "x", "xxxx", "x", "x", "x"]
    with pytest.raises(UserError, match="too small"):
        fiducial((160, 95))


@pytest.fixture(scope="module")
def drawn():
    pose = random_pose(11)
    frame, grid = photograph(pose), fiducial(pose.shape)
    found = register(torch.from_numpy(frame)[None], grid)
    return frame, grid, found, grid_picture(frame, grid, found)


def pixels(picture: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    """Places ``(N, 2)`` in the picture, x and y, that have exactly this colour."""
    return np.argwhere((picture == colour).all(axis=-1))[:, ::-1]


def test_it_is_the_capture_enlarged_a_whole_number_of_times_with_the_border_of_the_region(drawn):
    frame, _, _, picture = drawn
    assert picture.dtype == np.uint8
    assert picture.ndim == 3
    larger = picture.shape[0] // frame.shape[0]
    assert picture.shape == (frame.shape[0] * larger, frame.shape[1] * larger, 3)
    assert min(picture.shape[:2]) >= 720
    frame, _, found, picture = drawn
    corners = found.warps[0].corners() * larger
    at = pixels(picture, BORDER)
    assert np.abs(at.min(axis=0) - corners.min(axis=0)).max() < 100
    assert np.abs(at.max(axis=0) - corners.max(axis=0)).max() < 100
    frame, grid, found, _ = drawn
    picture = grid_picture(np.zeros_like(frame), grid, found)
    assert pixels(picture, MARK).size > 0


@pytest.mark.parametrize(("colour", "marks"), [(CIRCLE, False), (MARK, True)])
def test_marks_and_other_circles_are_outlined_where_they_are_in_their_colours(drawn, colour, marks):
    frame, grid, found, picture = drawn
    larger = picture.shape[0] // frame.shape[0]
    centres = found.warps[0].to_sensor(grid.centres) * larger
    at = pixels(picture, colour)
    assert len(at) > 100
    nearest = np.linalg.norm(at[:, None] - centres, axis=-1).argmin(axis=1)
    assert (grid.marks[nearest] == marks).all()
    assert set(nearest) == set(np.flatnonzero(grid.marks == marks))


GRID = fiducial((120, 140))
STILL = Warp(GRID.shape, np.eye(3), np.zeros((6, 2)))
IMAGE = GRID.image.numpy()


def moved(x, y):
    """The template displaced by x and y pixels."""
    return cv2.warpAffine(
        subpixel.template(GRID), np.float32([[1, 0, x], [0, 1, y]]), GRID.shape[::-1], flags=cv2.INTER_CUBIC
    )


def test_bright_light_counts_as_simply_bright_and_none_below_zero():
    assert subpixel.compress(np.float32([-1, 0, subpixel.KNEE, 1, 1e6])) == pytest.approx([0, 0, 0.5, 1 / 1.2, 1.0])


@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (0.2, 0.0), (0.0, -0.2), (-0.15, 0.1)])
@pytest.mark.parametrize("gain", [1.0, 0.3])
def test_a_step_towards_a_displacement_leaves_a_third_of_it_whatever_gain_and_offset(x, y, gain):
    found = subpixel.offsets(gain * moved(x, y) + 0.1, GRID)
    assert found.shape == GRID.centres.shape
    assert np.linalg.norm(found - [x, y], axis=1).max() < 0.35 * np.hypot(x, y) + 0.01  # linearised: steps are repeated


def test_a_circle_is_moved_by_at_most_two_pixels_and_one_that_is_not_there_by_none_of_its_own():
    draw = np.random.default_rng(0).random(GRID.shape).astype(np.float32)
    assert np.abs(subpixel.offsets(draw, GRID)).max() == subpixel.FURTHEST_CIRCLE == 2.0
    blank = subpixel.template(GRID).copy()
    column, row = np.round(GRID.centres[9]).astype(int)
    blank[row - 8 : row + 9, column - 8 : column + 9] = 0.0
    assert np.abs(subpixel.offsets(blank, GRID)).max() < 0.05


def test_even_light_gives_the_template():
    picture = subpixel.even_picture(IMAGE, STILL, GRID)
    columns, rows = np.round(GRID.centres).astype(int).T
    assert picture[rows, columns] == pytest.approx(1 / (1 + subpixel.KNEE), abs=0.03)
    assert picture[IMAGE == 0].max() < 0.25
    assert subpixel.correlation(picture, GRID) > 0.999


def test_a_beam_and_scattered_light_are_taken_out():
    y, x = np.mgrid[: GRID.shape[0], : GRID.shape[1]]
    beam = np.exp(-((x - 20) ** 2 + (y - 90) ** 2) / (2 * 90.0**2))
    uneven = (7 * beam * (IMAGE + 0.2)).astype(np.float32)
    picture = subpixel.even_picture(uneven, STILL, GRID)
    assert subpixel.correlation(picture, GRID) > 0.995
    assert np.abs(subpixel.offsets(picture, GRID)).max() < 0.1
    assert np.abs(subpixel.offsets(subpixel.compress(uneven), GRID)).max() > 0.1


def test_correlation_is_one_with_the_template_and_not_changed_by_light_far_from_the_circles():
    assert subpixel.correlation(subpixel.template(GRID), GRID) == pytest.approx(1.0)
    bright = subpixel.template(GRID).copy()
    bright[:3] = bright[:, :3] = 9.0
    assert subpixel.correlation(bright, GRID) == pytest.approx(1.0)
    assert subpixel.correlation(1 - subpixel.template(GRID), GRID) == pytest.approx(-1.0)


SHAPE = (5, 9)
HOMOGRAPHY = np.array([[1.5, 0.2, 3.0], [-0.1, 1.4, 7.0], [1e-3, -2e-3, 1.0]])
QUADRATIC = np.random.default_rng(0).normal(0, 0.3, (6, 2))


def points():
    x, y = np.meshgrid(np.arange(9.0), np.arange(5.0))
    return np.stack([x.ravel(), y.ravel()], axis=1)


def test_points_are_bent_and_then_seen_in_perspective():
    x, y = 6.0, 3.0
    u, v = 0.5, 0.5
    terms = np.array([1, u, v, u * u, u * v, v * v])
    x, y = x + terms @ QUADRATIC[:, 0], y + terms @ QUADRATIC[:, 1]
    depth = 1e-3 * x - 2e-3 * y + 1
    expected = [(1.5 * x + 0.2 * y + 3) / depth, (-0.1 * x + 1.4 * y + 7) / depth]
    assert Warp(SHAPE, HOMOGRAPHY, QUADRATIC).to_sensor(np.array([[6.0, 3.0]]))[0] == pytest.approx(expected)


def test_pixels_and_corners_go_where_points_go():
    warp = Warp(SHAPE, HOMOGRAPHY, QUADRATIC)
    where = warp.to_sensor(points()).reshape(5, 9, 2)
    across, down = warp.coordinates()
    assert across.dtype == down.dtype == np.float32
    assert np.allclose(np.stack([across, down], -1), where, atol=1e-5)
    assert np.allclose(warp.corners(), where[[0, 0, -1, -1], [0, -1, 0, -1]])


def test_the_scale_is_that_of_areas_at_the_middle():
    turned = np.array([[0, -3.0, 5], [2.0, 0, 1], [0, 0, 1]])
    assert Warp(SHAPE, turned, np.zeros((6, 2))).scale() == pytest.approx(math.sqrt(6))
    stretched = np.zeros((6, 2))
    stretched[3, 0] = 2.0  # uu along x: no slope at the middle, and much at the ends
    assert Warp((5, 4001), np.eye(3), stretched).scale() == pytest.approx(1.0, abs=1e-5)
    stretched[1, 0] = 2.0  # u along x: 4 px more over 8
    assert Warp(SHAPE, np.eye(3), stretched * [[0], [1], [0], [0], [0], [0]]).scale() == pytest.approx(math.sqrt(1.5))


def test_a_frame_is_sampled_at_its_pixels_and_dark_outside():
    frame = np.random.default_rng(1).random((12, 14)).astype(np.float32)
    moved = np.array([[1, 0, 8.0], [0, 1, 4.0], [0, 0, 1]])
    seen = Warp(SHAPE, moved, np.zeros((6, 2))).sample(frame)
    assert np.array_equal(seen[:, :6], frame[4:9, 8:14])
    assert not seen[:, 7:].any()
    half = remap(np.tile(np.arange(8, dtype=np.float32), (8, 1)), np.float32([[3.5]]), np.float32([[4]]))
    assert half == pytest.approx(3.5)


FILTERS = [[0.2, -0.5, 1.0], [0.0, 0.7, 0.1]]


@pytest.mark.parametrize("dim", [-2, -1])
def test_each_filter_gives_what_a_convolution_gives(dim):
    image = torch.rand(2, 9, 7, dtype=torch.float64)
    kernels = torch.tensor(FILTERS, dtype=torch.float64)
    kernels = kernels[:, None, :, None] if dim == -2 else kernels[:, None, None, :]
    assert torch.allclose(correlate_each(image, FILTERS, dim), functional.conv2d(image[:, None], kernels))
    assert torch.equal(correlate(image, FILTERS[1], dim), correlate_each(image, FILTERS, dim)[:, 1])


@pytest.mark.parametrize("dim", [-2, -1])
def test_the_gradient_of_a_correlation_is_its_derivative(dim):
    image = torch.rand(2, 5, 6, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda x: correlate_each(x, FILTERS, dim), image)
