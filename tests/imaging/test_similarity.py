"""Pictures are compared part by part, apart from illumination, where the capture is."""

import numpy as np
import pytest

from holobench_eval.imaging.similarity import SIDE, evened, reduced, similarity, structured, view
from holobench_eval.imaging.warp import Warp
from tests.support.photographed import photograph

TARGET = photograph("astronaut", (120, 180)).mean(axis=0).astype(np.float32)


def warp(across=0.0, down=0.0, scale=1.0, shape=TARGET.shape):
    homography = np.array([[scale, 0, across], [0, scale, down], [0, 0, 1.0]])
    return Warp(shape, homography, np.zeros((6, 2)))


def test_a_reduced_picture_has_the_means_of_areas_and_knows_where_they_lie():
    fine = np.random.default_rng(0).random((60, 120)).astype(np.float32)
    small, back = reduced(fine, 40)
    assert small == pytest.approx(fine.reshape(20, 3, 40, 3).mean(axis=(1, 3)), abs=1e-6)
    assert back @ [0, 0, 1] == pytest.approx([1, 1, 1])  # the middle of the first 3 x 3 pixels
    assert back @ [39, 19, 1] == pytest.approx([118, 58, 1])
    wide, back = reduced(fine[:59], 50)
    assert wide.shape == (25, 50)
    assert back @ [-0.5, -0.5, 1] == pytest.approx([-0.5, -0.5, 1])  # borders lie on borders
    assert back @ [49.5, 24.5, 1] == pytest.approx([119.5, 58.5, 1])


def test_a_small_picture_is_not_reduced():
    for side in (180, 200):
        small, back = reduced(TARGET, side)
        assert small is TARGET
        assert np.array_equal(back, np.eye(3))
    assert reduced(TARGET[:1], 90)[0].shape == (1, 90)


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_a_view_shows_target_and_capture_in_one_frame_and_says_where_the_capture_ends(scale):
    frame = np.kron(TARGET, np.ones((int(scale), int(scale)), np.float32))
    seen = view(frame, TARGET, warp(0.5 * (scale - 1), 0.5 * (scale - 1), scale))
    assert seen.reference.shape == seen.picture.shape == (64, SIDE)
    assert seen.inside[1:-1, 1:-1].all()
    assert np.abs(seen.reference - seen.picture)[2:-2, 2:-2].mean() < 0.03
    half = view(frame[:, : frame.shape[1] // 2], TARGET, warp(0.5 * (scale - 1), 0.5 * (scale - 1), scale))
    assert half.inside[2:-2, 2:46].all()
    assert not half.inside[:, 49:].any()


def test_an_evened_picture_keeps_structure_and_loses_illumination():
    everywhere = np.ones(TARGET.shape, bool)
    ramp = np.linspace(0.5, 1.5, TARGET.shape[1], dtype=np.float32)
    plain, lit = evened(TARGET, everywhere), evened(0.3 * TARGET * ramp, everywhere)
    assert np.corrcoef(plain.ravel(), lit.ravel())[0, 1] > 0.98
    assert np.abs(plain).max() < 4


def test_what_lies_outside_has_no_part_in_an_evened_picture():
    inside = np.ones(TARGET.shape, bool)
    inside[:, 90:] = False
    other = TARGET.copy()
    other[:, 90:] = 9.0
    assert np.array_equal(evened(TARGET, inside), evened(other, inside))
    assert not evened(TARGET, inside)[:, 90:].any()


def test_a_picture_is_wholly_like_itself_and_no_part_is_displaced():
    alike = similarity(TARGET, TARGET, warp())
    assert alike.overall == pytest.approx(1.0, abs=1e-3)
    assert len(alike.parts) == len(structured(TARGET)) == 9
    assert min(alike.parts) > 0.999
    assert not any(alike.displaced)
    assert similarity(1 - TARGET, TARGET, warp()).overall < -0.9


@pytest.mark.parametrize("step", [(8, 0), (0, 8), (-8, 0)])
def test_parts_that_lie_elsewhere_are_displaced_and_those_two_pixels_away_are_not(step):
    moved = np.roll(TARGET, step, axis=(0, 1))
    assert sum(similarity(moved, TARGET, warp()).displaced) >= 5  # 4 px of the reduced picture
    near = np.roll(TARGET, [np.sign(each) * 3 for each in step], axis=(0, 1))
    assert not any(similarity(near, TARGET, warp()).displaced)  # 1.6 px


def test_half_a_target_that_is_covered_can_be_compared_and_less_cannot():
    covered = similarity(TARGET[:, :100], TARGET, warp())
    assert covered.overall > 0.99
    assert len(covered.parts) < 9
    assert similarity(TARGET[:, :80], TARGET, warp()).overall == -1.0
    assert similarity(TARGET[:, :80], TARGET, warp()).parts == ()


def test_parts_are_ninths_and_hold_structure_above_a_level_of_eight_bits():
    flat = np.full((90, 60), 0.5, np.float32)
    draw = np.random.default_rng(0)
    flat[30:60, :20] += 0.006 * draw.choice([-1, 1], (30, 20)).astype(np.float32)
    flat[:30, 40:] += 0.002 * draw.choice([-1, 1], (30, 20)).astype(np.float32)
    assert structured(flat) == [(slice(30, 60), slice(0, 20))]
    assert structured(np.full((90, 60), 0.5, np.float32)) == []
