"""The acceptance line of registration, over 200 random poses and over pictures of something else."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from skimage import data

from holobench_eval.imaging import Warp, fiducial, register
from holobench_eval.imaging.register import mismatch
from holobench_eval.testing.grid_poses import corner_points, photograph, random_pose, speckle
from holobench_eval.testing.registration_conformance import Outcome, accepted_impostors, conforms, errors, outcomes
from tests.study.studies import one_line


def test_over_100_poses_the_median_corner_error_is_small_none_is_silently_wrong_and_few_are_refused():
    seen = outcomes(range(100))
    assert np.nanmedian(errors(seen)) <= 0.2
    assert [each.pose.number for each in seen if each.error > 1] == []
    assert np.isnan(errors(seen)).sum() <= 3


def test_the_poses_are_as_hard_as_they_should_be():
    poses = [random_pose(number) for number in range(100)]
    assert min(p.contrast for p in poses) < 0.05
    assert max(p.contrast for p in poses) > 0.95
    assert max(p.perspective for p in poses) > 0.095
    assert min(p.corner for p in poses) < 0.35
    assert len({(p.quarter_turns, p.mirrored, p.shape) for p in poses}) == 8 * 5


def test_strong_perspective_makes_opposite_sides_differ_by_what_it_says():
    pose = max((random_pose(number) for number in range(200)), key=lambda each: each.perspective)
    corners = np.column_stack([corner_points(pose.shape), np.ones(4)]) @ pose.homography.T
    a, b, c, d = corners[:, :2] / corners[:, 2:]
    across, down = (
        abs(np.log(np.linalg.norm(one) / np.linalg.norm(two))) for one, two in ((a - b, c - d), (a - c, b - d))
    )
    assert 0.07 < np.hypot(across, down) < 0.13


@pytest.mark.parametrize("contrast", [0.3, 1.0])
def test_the_speckle_has_the_contrast_and_the_grain_it_says(contrast):
    light = speckle((900, 900), contrast, np.random.default_rng(0))
    assert light.mean() == pytest.approx(1, rel=0.02)
    assert light.std() / light.mean() == pytest.approx(contrast, rel=0.03)
    if contrast == 1:
        spectrum = np.abs(np.fft.fft2(light - light.mean())) ** 2
        alike = np.fft.ifft2(spectrum).real[0] / np.fft.ifft2(spectrum).real[0, 0]
        assert alike[1] > 0.7  # a third of a region pixel away
        assert alike[6] < 0.1  # two region pixels away


def test_no_impostor_and_no_partial_view_is_taken_for_the_grid():
    accepted, count = accepted_impostors((160, 160), 1)
    assert count > 20
    assert accepted == []


@pytest.mark.parametrize("name", ["camera", "text", "retina", "checkerboard"])
def test_a_photograph_of_something_else_is_refused_in_one_line(name):
    frame = getattr(data, name)().astype(np.float32)
    frame = frame[..., 1] if frame.ndim == 3 else frame
    with one_line("registration of channel 0: "):
        register(torch.from_numpy(np.ascontiguousarray(frame[:700, :700]))[None], fiducial((160, 160)))


def test_circles_that_go_on_and_circles_in_between_are_told_apart_from_the_grid_itself():
    pose = random_pose(1, (160, 160))
    grid, warp = fiducial(pose.shape), Warp(pose.shape, pose.homography, np.zeros((6, 2)))

    def with_another(spacings: float) -> np.ndarray:
        beside = np.array([[1, 0, spacings * grid.spacing], [0, 1, 0], [0, 0, 1]])
        return photograph(pose) + photograph(replace(pose, homography=pose.homography @ beside))

    assert mismatch(photograph(pose), warp, grid) is None
    assert "go on beyond 8x8" in (mismatch(with_another(1.0), warp, grid) or "")
    assert "not this grid alone" in (mismatch(with_another(0.5), warp, grid) or "")


def test_conformance_wants_few_refusals_small_errors_and_no_silent_ones():
    pose = random_pose(0)
    good = [Outcome(pose, 0.1)] * 99
    assert conforms(good)
    assert conforms([*good, Outcome(pose, float("nan"))])
    assert not conforms([*good, Outcome(pose, 1.1)])
    assert not conforms([*good[:9], Outcome(pose, float("nan"))])
    assert not conforms([Outcome(pose, 0.3)] * 10)
