"""The map from the region to the sensor: what it does to points, to the grid of pixels and to a frame."""

import math

import numpy as np
import pytest

from holobench_eval.imaging.warp import Warp, remap

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
