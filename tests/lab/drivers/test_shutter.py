"""Shutter speeds as cameras write them, and the times that they stand for."""

import math

import pytest

from holobench_eval.lab.drivers.gphoto2_camera import exact, nearest, seconds, speeds

THIRDS = "30 25 20 15 13 10 8 6 5 4 3.2 2.5 2 1.6 1.3 1 0.8 0.6 0.5 0.4 0.3 1/4 1/5 1/6 1/8 1/10 1/13 1/15 1/20 1/25 1/30 1/40 1/50 1/60 1/80 1/100 1/125 1/160 1/200 1/250 1/320 1/400 1/500 1/640 1/800 1/1000 1/4000"  # noqa: E501
HALVES = "30 20 15 10 8 6 4 3 2 1.5 1 0.7 0.5 0.3 1/4 1/6 1/8 1/10 1/15 1/20 1/30 1/45 1/60 1/90 1/125 1/180 1/250 1/350 1/500"  # noqa: E501


TIMES = {
    "1/125": 1 / 125,
    "0.5": 0.5,
    "30": 30,
    "0.0100s": 0.01,
    '1"3': 1.3,
    '2"': 2,
    "10/25": 0.4,
    " 1/60 sec": 1 / 60,
}
NO_TIMES = ["bulb", "", "0", "1/0", "-1", "nan", "inf", "0x10"]


@pytest.mark.parametrize(("text", "time"), [*TIMES.items(), *((text, None) for text in NO_TIMES)])
def test_speeds_are_read_as_cameras_write_them(text: str, time: float | None) -> None:
    assert seconds(text) == (time if time is None else pytest.approx(time))


def test_what_is_no_time_is_left_out_and_the_rest_is_sorted() -> None:
    assert list(speeds(["bulb", "30", "1/125", "0.5", "auto"]).values()) == ["1/125", "0.5", "30"]


def test_the_nearest_speed_is_nearest_by_ratio() -> None:
    assert nearest([0.01, 0.1], 0.04) == 0.1


@pytest.mark.parametrize(("listed", "parts"), [(THIRDS, 3), (HALVES, 2)])
def test_written_times_become_exact_stops(listed: str, parts: int) -> None:
    times = exact(speeds(listed.split()))
    assert (times[1 / 60], times[30], times[1 / 125]) == (1 / 64, 32, 1 / 128)
    steps = sorted(math.log2(time) * parts for time in times.values())
    assert len(set(steps)) == len(times)
    assert all(step == pytest.approx(round(step)) for step in steps)


def test_a_list_of_other_times_is_taken_at_its_word() -> None:
    times = [milliseconds / 1000 for milliseconds in range(1, 40)]
    assert exact(times) == {time: time for time in times}
