import numpy as np
import pytest

from holobench_eval.imaging.convention import Convention
from holobench_eval.lab.devices import DeviceError
from holobench_eval.lab.exposure import averaged
from holobench_eval.lab.settle import Toggle, settle_time
from tests.support.simulated_devices import GREEN, Scene, SimulatedCamera, SimulatedSlm, bench, pattern_phase


def toggle(scene, **camera):
    panel, device = SimulatedSlm(scene), SimulatedCamera(scene, **{"noise": 2.0, **camera})
    scene.channel = GREEN
    letter = pattern_phase()[GREEN]
    levels = {bright: Convention().levels(letter * bright) for bright in (True, False)}
    return Toggle(
        show=lambda bright: panel.show(levels[bright]),
        take=lambda: averaged(device, 0.02, 1, 0).counts,
        wait=scene.clock.wait,
    )


@pytest.mark.parametrize(("latency", "lag"), [(0.0, 0.0), (0.05, 0.0), (0.0, 0.02), (0.03, 0.05)])
def test_the_measured_time_is_enough_and_no_more_than_three_times_too_long(latency, lag):
    scene = Scene(bench(), latency=latency, lag=lag)
    seconds = settle_time(toggle(scene))
    needed = latency + 3.9 * lag  # exp(-3.9) is 2 %
    assert needed <= seconds <= max(3.1 * needed, 0.0076)


@pytest.mark.parametrize(
    ("scene", "line"),
    [
        ({"lag": 4.0}, "still changes by .* after 1.5 s"),
        ({"latency": 1.2}, "still changes 1 s after"),
        ({"restless": 0.5}, "still changes by .* laser's power"),
    ],
)
def test_a_bench_that_never_settles_is_one_line(scene, line):
    with pytest.raises(DeviceError, match=line) as error:
        settle_time(toggle(Scene(bench(), **scene)))
    assert "\n" not in str(error.value)


def test_a_panel_that_the_camera_does_not_see_is_one_line():
    blind = toggle(Scene(bench()))
    same = Toggle(blind.show, lambda: np.full((30, 30), 200.0), blind.wait)
    with pytest.raises(DeviceError, match="is this the panel that the camera sees"):
        settle_time(same)
