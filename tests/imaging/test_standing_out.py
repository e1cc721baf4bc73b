"""Pixels that stand out from all around them."""

import numpy as np

from holobench_eval.imaging.standing_out import hot_and_dead


def places(mask: np.ndarray) -> list[tuple[int, ...]]:
    return [tuple(place) for place in np.argwhere(mask)]


def test_hot_pixels_are_those_brighter_than_all_around_them_and_dead_ones_darker():
    frame = np.random.default_rng(0).integers(900, 1100, (40, 40)).astype(np.float32)
    frame[10, 10], frame[0, 0], frame[20:22, 20], frame[30, 5] = 4000, 3000, 4000, 0
    hot, dead = hot_and_dead(frame)
    assert places(hot) == [(0, 0), (10, 10)]
    assert places(dead) == [(30, 5)]


def test_a_frame_that_is_even_has_neither():
    assert not np.any(hot_and_dead(np.full((8, 8), 7, np.float32)))
