import math
from itertools import product

import cv2
import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from skimage import data
from torch import Tensor

from holobench_eval.imaging import refine
from tests.support.benches.simulated_grid import random

SIDE = 160


def picture(name: str) -> np.ndarray:
    """Linear light ``(3, 8 SIDE / 5, 8 SIDE / 5)``: the middle 5 eighths are the target, the rest may move in."""
    image = getattr(data, name)()[:300, :300] / 255.0
    image = cv2.resize(image, (8 * SIDE // 5, 8 * SIDE // 5), interpolation=cv2.INTER_AREA)
    return cv2.GaussianBlur(image**2.2, (0, 0), 0.7).transpose(2, 0, 1)


def seen(image: np.ndarray, dx: float = 0.0, dy: float = 0.0, theta: float = 0.0) -> Tensor:
    """The middle of an image when the scene has moved by dx, dy [px] and turned by theta [degrees] about the centre."""
    first = (image.shape[-1] - SIDE) / 2
    y, x = np.mgrid[:SIDE, :SIDE] - (SIDE - 1) / 2.0
    cosine, sine = math.cos(math.radians(theta)), math.sin(math.radians(theta))
    column = cosine * (x - dx) + sine * (y - dy) + (SIDE - 1) / 2 + first
    row = -sine * (x - dx) + cosine * (y - dy) + (SIDE - 1) / 2 + first
    where = column.astype(np.float32), row.astype(np.float32)
    planes = [cv2.remap(plane.astype(np.float32), *where, cv2.INTER_CUBIC) for plane in image]
    return torch.from_numpy(np.stack(planes))


def speckled(image: Tensor, name: object, looks: int = 2) -> Tensor:
    draw = random("refine", name)
    return image * torch.from_numpy(draw.gamma(looks, 1 / looks, image.shape)).float()


PICTURES = {name: picture(name) for name in ("astronaut", "coffee", "chelsea")}


WELL_WITHIN = [(0.3, -0.2, 0.0), (1.4, -1.1, 0.05), (-0.5, 1.7, -0.08)]
JUST_WITHIN = [(1.9, 0.0, 0.0), (1.3, -1.3, 0.0), (0.0, 0.0, -0.09)]


@pytest.mark.parametrize(
    ("name", "move"), [*product(PICTURES, WELL_WITHIN), *(("astronaut", move) for move in JUST_WITHIN)]
)
def test_a_known_move_is_recovered_to_a_twentieth_of_a_pixel(name, move):
    target = seen(PICTURES[name])
    found = refine(seen(PICTURES[name], *move), target)
    assert (found.dx, found.dy) == pytest.approx(move[:2], abs=0.05)
    assert found.theta == pytest.approx(move[2], abs=0.02)
    inner = np.s_[:, 6:-6, 6:-6]
    moved = seen(PICTURES[name], *move)
    assert (found.image - target)[inner].square().mean() < 0.1 * (moved - target)[inner].square().mean()


@pytest.mark.parametrize("rows", [slice(30, -30), slice(0, None)])
def test_a_turn_is_about_the_centre_of_a_target_of_any_shape(rows):
    target, moved = (
        seen(PICTURES["coffee"])[:, rows, 20:-20],
        seen(PICTURES["coffee"], 0.7, -0.4, 0.09)[:, rows, 20:-20],
    )
    found = refine(moved, target)
    assert (found.dx, found.dy) == pytest.approx((0.7, -0.4), abs=0.05)
    assert found.theta == pytest.approx(0.09, abs=0.02)
    inner = np.s_[:, 6:-6, 6:-6]
    assert (found.image - target)[inner].square().mean() < 0.1 * (moved - target)[inner].square().mean()


@pytest.mark.parametrize("name", PICTURES)
def test_an_aligned_pair_stays(name):
    target = seen(PICTURES[name])
    noisy = target + 0.02 * torch.from_numpy(random("aligned", name).standard_normal(target.shape)).float()
    for capture in (target, 0.4 * target, noisy):
        found = refine(capture, target)
        assert math.hypot(found.dx, found.dy) < 0.02
        assert abs(found.theta) < 0.01


@pytest.mark.parametrize("name", PICTURES)
def test_speckle_and_stray_light_leave_a_tenth_of_a_pixel(name):
    target = seen(PICTURES[name])
    for move in ((0.0, 0.0, 0.0), (0.6, -0.4, 0.0)):
        found = refine(speckled(seen(PICTURES[name], *move), (name, move)) + 0.05, target)
        assert (found.dx, found.dy) == pytest.approx(move[:2], abs=0.1)


@given(dx=st.floats(-6, 6), dy=st.floats(-6, 6), theta=st.floats(-0.6, 0.6))
def test_no_move_exceeds_the_bounds_and_the_rest_is_left_alone(dx, dy, theta):
    capture = seen(PICTURES["coffee"], dx, dy, theta)
    found = refine(capture, seen(PICTURES["coffee"]))
    assert math.hypot(found.dx, found.dy) <= 2.0
    assert abs(found.theta) <= 0.1
    if (found.dx, found.dy, found.theta) == (0.0, 0.0, 0.0):
        assert torch.equal(found.image, capture)


@pytest.mark.parametrize("move", [(2.5, 0.0, 0.0), (0.0, -4.0, 0.0), (0.0, 0.0, 0.3)])
def test_a_move_beyond_the_bounds_returns_the_capture_itself(move):
    capture = seen(PICTURES["astronaut"], *move)
    found = refine(capture, seen(PICTURES["astronaut"]))
    assert torch.equal(found.image, capture)
    assert (found.dx, found.dy, found.theta) == (0.0, 0.0, 0.0)


def test_a_move_that_would_lower_the_correlation_is_not_taken():
    """On this pair, hardly related, the linearised search ends 0.3 px off with a correlation of 0.494 for 0.495."""
    draw = random("unrelated", 445)
    share = 0.5 * draw.random()
    one, other = (cv2.GaussianBlur(draw.random((48, 48)), (0, 0), 1.5).astype(np.float32) for _ in range(2))
    capture = torch.from_numpy(one)[None]
    found = refine(capture, torch.from_numpy(share * one + (1 - share) * other)[None])
    assert (found.dx, found.dy, found.theta) == (0.0, 0.0, 0.0)
    assert torch.equal(found.image, capture)


def test_pictures_without_structure_or_relation_return_the_capture_itself():
    target = seen(PICTURES["coffee"])
    flat = torch.full_like(target, 0.5)
    ramp = torch.linspace(0, 1, SIDE).expand_as(target)
    for capture, wanted in ((flat, target), (target, flat), (0 * flat, target), (ramp, ramp), (1 - target, target)):
        assert torch.equal(refine(capture, wanted).image, capture)


def test_one_move_serves_all_channels():
    moved = seen(PICTURES["chelsea"], 0.8, -0.6, 0.0)
    found = refine(moved, seen(PICTURES["chelsea"]))
    alone = [refine(moved[[channel]], seen(PICTURES["chelsea"])[[channel]]) for channel in range(3)]
    assert all(found.dx == pytest.approx(each.dx, abs=0.05) for each in alone)
    swapped = refine(moved.flip(0), seen(PICTURES["chelsea"]).flip(0))
    assert torch.allclose(swapped.image.flip(0), found.image, atol=1e-5)


def test_shapes_that_differ_are_refused():
    with pytest.raises(ValueError, match="must both be"):
        refine(torch.zeros(3, 64, 64), torch.zeros(3, 64, 65))
    for small in ((3, 16, 64), (3, 64, 16), (64, 64)):
        with pytest.raises(ValueError, match="above 16 px"):
            refine(torch.zeros(small), torch.zeros(small))
    assert refine(torch.zeros(1, 17, 17), torch.zeros(1, 17, 17)).image.shape == (1, 17, 17)
