"""Circles are measured where they are, under even and uneven light."""

import cv2
import numpy as np
import pytest

from holobench_eval.imaging import fiducial
from holobench_eval.imaging.subpixel import (
    FURTHEST_CIRCLE,
    KNEE,
    compress,
    correlation,
    even_picture,
    offsets,
    template,
)
from holobench_eval.imaging.warp import Warp

GRID = fiducial((120, 140))
STILL = Warp(GRID.shape, np.eye(3), np.zeros((6, 2)))
IMAGE = GRID.image.numpy()


def moved(x, y):
    """The template displaced by x and y pixels."""
    return cv2.warpAffine(template(GRID), np.float32([[1, 0, x], [0, 1, y]]), GRID.shape[::-1], flags=cv2.INTER_CUBIC)


def test_bright_light_counts_as_simply_bright_and_none_below_zero():
    assert compress(np.float32([-1, 0, KNEE, 1, 1e6])) == pytest.approx([0, 0, 0.5, 1 / 1.2, 1.0])


@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (0.2, 0.0), (0.0, -0.2), (-0.15, 0.1)])
@pytest.mark.parametrize("gain", [1.0, 0.3])
def test_a_step_towards_a_displacement_leaves_a_third_of_it_whatever_gain_and_offset(x, y, gain):
    found = offsets(gain * moved(x, y) + 0.1, GRID)
    assert found.shape == GRID.centres.shape
    assert np.linalg.norm(found - [x, y], axis=1).max() < 0.35 * np.hypot(x, y) + 0.01  # linearised: steps are repeated


def test_a_circle_is_moved_by_at_most_two_pixels_and_one_that_is_not_there_by_none_of_its_own():
    draw = np.random.default_rng(0).random(GRID.shape).astype(np.float32)
    assert np.abs(offsets(draw, GRID)).max() == FURTHEST_CIRCLE == 2.0
    blank = template(GRID).copy()
    column, row = np.round(GRID.centres[9]).astype(int)
    blank[row - 8 : row + 9, column - 8 : column + 9] = 0.0
    assert np.abs(offsets(blank, GRID)).max() < 0.05


def test_even_light_gives_the_template():
    picture = even_picture(IMAGE, STILL, GRID)
    columns, rows = np.round(GRID.centres).astype(int).T
    assert picture[rows, columns] == pytest.approx(1 / (1 + KNEE), abs=0.03)
    assert picture[IMAGE == 0].max() < 0.25
    assert correlation(picture, GRID) > 0.999


def test_a_beam_and_scattered_light_are_taken_out():
    y, x = np.mgrid[: GRID.shape[0], : GRID.shape[1]]
    beam = np.exp(-((x - 20) ** 2 + (y - 90) ** 2) / (2 * 90.0**2))
    uneven = (7 * beam * (IMAGE + 0.2)).astype(np.float32)
    picture = even_picture(uneven, STILL, GRID)
    assert correlation(picture, GRID) > 0.995
    assert np.abs(offsets(picture, GRID)).max() < 0.1
    assert np.abs(offsets(compress(uneven), GRID)).max() > 0.1


def test_correlation_is_one_with_the_template_and_not_changed_by_light_far_from_the_circles():
    assert correlation(template(GRID), GRID) == pytest.approx(1.0)
    bright = template(GRID).copy()
    bright[:3] = bright[:, :3] = 9.0
    assert correlation(bright, GRID) == pytest.approx(1.0)
    assert correlation(1 - template(GRID), GRID) == pytest.approx(-1.0)
