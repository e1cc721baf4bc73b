"""The part of a target that is on a capture: a rectangle of its pixels."""

from __future__ import annotations

import numpy as np

from holobench_eval.imaging.warp import Warp
from holobench_eval.study.folders.visible import cropped, largest_part, share, shown


def moved(x: float, y: float, shape: tuple[int, int] = (40, 60)) -> Warp:
    return Warp(shape, np.array([[2.0, 0, x], [0, 2, y], [0, 0, 1]]), np.zeros((6, 2)))


def test_a_target_on_the_capture_or_two_pixels_beyond_is_shown_whole():
    assert shown(moved(0, 0), (100, 140)).all()
    assert shown(moved(-4, 0), (100, 140)).all()
    assert not shown(moved(-5, 0), (100, 140)).all()


def test_what_lies_beyond_two_sides_is_left_out_to_the_pixel():
    mask = shown(moved(-20, -11), (60, 140))
    part = largest_part(mask)
    assert part == (6, 36, 10, 60)
    assert share(part, mask.shape) == 30 * 50 / (40 * 60)
    assert mask[6:36, 10:60].all()


def test_a_turned_border_leaves_a_rectangle_that_is_shown_everywhere():
    y, x = np.mgrid[:80, :100]
    mask = x > 20 + 0.2 * y
    part = largest_part(mask)
    assert mask[part[0] : part[1], part[2] : part[3]].all()
    assert share(part, mask.shape) > 0.6


def test_nothing_shown_has_no_part():
    assert share(largest_part(np.zeros((40, 60), dtype=bool)), (40, 60)) == 0


def test_the_map_of_a_part_leads_to_the_same_places():
    part = cropped(moved(3, 7), (6, 36, 10, 60))
    assert part.shape == (30, 50)
    assert np.allclose(part.corners()[0], moved(3, 7).to_sensor(np.array([[10.0, 6.0]]))[0])
