import numpy as np
import pytest
import torch

from holobench_eval.imaging import fiducial, register
from holobench_eval.imaging.grid_picture import BORDER, CIRCLE, MARK, grid_picture
from holobench_eval.testing.grid_poses import photograph, random_pose


@pytest.fixture(scope="module")
def drawn():
    pose = random_pose(11)
    frame, grid = photograph(pose), fiducial(pose.shape)
    found = register(torch.from_numpy(frame)[None], grid)
    return frame, grid, found, grid_picture(frame, grid, found)


def pixels(picture: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    """Places ``(N, 2)`` in the picture, x and y, that have exactly this colour."""
    return np.argwhere((picture == colour).all(axis=-1))[:, ::-1]


def test_it_is_the_capture_enlarged_a_whole_number_of_times(drawn):
    frame, _, _, picture = drawn
    assert picture.dtype == np.uint8
    assert picture.ndim == 3
    larger = picture.shape[0] // frame.shape[0]
    assert picture.shape == (frame.shape[0] * larger, frame.shape[1] * larger, 3)
    assert min(picture.shape[:2]) >= 720


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


def test_the_border_goes_round_the_region(drawn):
    frame, _, found, picture = drawn
    larger = picture.shape[0] // frame.shape[0]
    corners = found.warps[0].corners() * larger
    at = pixels(picture, BORDER)
    assert np.abs(at.min(axis=0) - corners.min(axis=0)).max() < 100
    assert np.abs(at.max(axis=0) - corners.max(axis=0)).max() < 100


def test_a_dark_capture_gives_a_dark_picture_without_failing(drawn):
    frame, grid, found, _ = drawn
    picture = grid_picture(np.zeros_like(frame), grid, found)
    assert pixels(picture, MARK).size > 0
