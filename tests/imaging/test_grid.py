import math

import numpy as np
import pytest
import torch

from holobench_eval.core.errors import UserError
from holobench_eval.imaging import fiducial

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
def test_the_lattice_is_square_centred_and_as_large_as_its_margin_allows(shape):
    grid = fiducial(shape)
    assert grid.spacing == pytest.approx(max(16, 18 * (min(shape) / 160) ** 0.75))
    lattice = grid.centres.reshape(grid.rows, grid.columns, 2)
    assert np.allclose(np.diff(lattice, axis=1), [grid.spacing, 0])
    assert np.allclose(np.diff(lattice, axis=0), [0, grid.spacing])
    assert np.allclose(lattice.mean(axis=(0, 1)), [(shape[1] - 1) / 2, (shape[0] - 1) / 2])
    margin = lattice[0, 0] / grid.spacing
    assert ((margin >= 0.7) & (margin < 1.2)).all()


@pytest.mark.parametrize("shape", SHAPES)
def test_discs_have_the_light_of_their_radii_and_marks_are_larger(shape):
    grid = fiducial(shape)
    assert (grid.radius, grid.mark_radius) == pytest.approx((0.28 * grid.spacing, 0.39 * grid.spacing))
    areas = math.pi * np.where(grid.marks, grid.mark_radius, grid.radius) ** 2
    assert float(grid.image.sum()) == pytest.approx(areas.sum(), rel=0.02)
    column, row = np.round(grid.centres[0]).astype(int)
    x, y = column - grid.centres[0, 0] + np.arange(9), row - grid.centres[0, 1]
    edge = np.clip((grid.mark_radius - np.hypot(x, y)) / 2 + 0.5, 0, 1)  # two pixels wide
    assert grid.image[row, column : column + 9].numpy() == pytest.approx(edge, abs=1e-6)


def test_the_marks_draw_an_f():
    grid = fiducial((160, 160))
    rows = ["".join(" x"[int(mark)] for mark in row).rstrip() for row in grid.marks.reshape(8, 8)]
    assert rows == ["xxxxxx", "x", "x", "x", "xxxx", "x", "x", "x"]


@pytest.mark.parametrize("shape", SHAPES)
def test_image_is_linear_light_of_the_region_with_a_dark_border(shape):
    grid = fiducial(shape)
    assert grid.image.shape == shape == grid.shape
    assert grid.image.dtype == torch.float32
    assert float(grid.image.min()) == 0.0
    assert float(grid.image.max()) == 1.0
    border = torch.ones(shape, dtype=torch.bool)
    border[4:-4, 4:-4] = False
    assert float(grid.image[border].max()) == 0.0


def test_a_region_too_small_for_a_grid_is_refused():
    with pytest.raises(UserError, match="too small"):
        fiducial((160, 95))
