import itertools

import pytest

from holobench_eval.report.charts.labels import spaced


def test_names_with_room_stay_where_they_are():
    assert spaced([1.0, 5.0, 9.0], 1.0, 0.0, 10.0) == pytest.approx([1, 5, 9])


def test_names_that_collide_are_pushed_apart_around_where_they_belong():
    assert spaced([4.9, 5.0, 5.1], 1.0, 0.0, 10.0) == pytest.approx([4, 5, 6])


@pytest.mark.parametrize("values", [[0.0, 0.0, 0.1], [9.9, 9.9, 10.0], [1.0, 1.2, 1.3, 4.0, 4.1]])
def test_names_keep_their_order_and_distance_within_the_axes(values):
    places = spaced(values, 1.0, 0.0, 10.0)
    assert all(after - before > 0.999 for before, after in itertools.pairwise(places))
    assert places[0] >= 0
    assert places[-1] <= 10.0 + 1e-9
