import numpy as np
import pytest

from holobench_eval.core.errors import LostDeviceError, UserError
from holobench_eval.imaging.convention import Convention
from holobench_eval.lab.bench_file import CaptureSettings
from holobench_eval.lab.dark import Dark, given_dark
from holobench_eval.lab.devices import DeviceError
from holobench_eval.lab.exposure import (
    WAITING,
    Averaged,
    FreshCamera,
    auto_exposure,
    averaged,
    combined,
    dark_frames,
    late,
    refuse_miscounted,
)
from holobench_eval.lab.settle import Toggle, settle_time
from tests.support.simulated_devices import GREEN, Scene, SimulatedCamera, SimulatedSlm, Still, bench, pattern_phase


def speckle(mean=1.0, shape=(60, 80)):
    return mean * np.random.default_rng(3).exponential(size=shape)


def camera(picture=None, **settings):
    return SimulatedCamera(Still(speckle() if picture is None else picture), **settings)


@pytest.mark.parametrize("light", [0.003, 1.0, 300.0])
def test_auto_exposure_fills_the_range_without_saturating_it(light):
    device = camera(speckle(light), noise=2.0)
    seconds = auto_exposure(device, 0)
    taken = averaged(device, seconds, 1, 0)
    fill = (np.percentile(taken.counts, 99.9) - 64) / (device.white - 64)
    assert 0.4 < fill < 0.95
    assert taken.saturated.mean() <= 0.001
    assert device.frames < 12


def test_auto_exposure_copes_with_shutters_that_know_only_full_stops():
    class Stops(SimulatedCamera):
        def expose(self, seconds):
            return super().expose(2.0 ** round(np.log2(seconds)))

    for light in np.geomspace(1, 2, 12):
        device = Stops(Still(speckle(light)))
        assert np.log2(auto_exposure(device, 0)) % 1 == 0


@pytest.mark.parametrize(
    ("light", "settings", "line"),
    [
        (1e9, {}, "too much light even at its shortest exposure"),
        (1e-6, {}, "too little light at its longest exposure"),
        (1.0, {"deaf": True, "gain": 1e8}, "too much light"),
    ],
)
def test_auto_exposure_says_why_there_is_none(light, settings, line):
    with pytest.raises(DeviceError, match=line) as error:
        auto_exposure(camera(speckle(light), **settings), 0)
    assert "\n" not in str(error.value)


def test_a_frame_from_before_the_panel_changed_is_refused_and_the_same_picture_twice_is_not():
    frames = iter(np.array(row, np.uint8)[None] for row in 4 * [[1, 2]] + [[3, 2]] + 2 * [[0, 0]])
    device = SimulatedCamera(Still(np.ones((1, 2))), exposures=(1e-5, 0.5))
    device.expose = lambda seconds: (next(frames) if seconds == 1 else np.zeros((1, 2), np.uint8), seconds)
    camera = FreshCamera(device)
    camera.changed("first")
    camera.expose(1.0)
    camera.changed("first")
    camera.expose(1.0)
    camera.changed("second")
    for _ in range(2):
        with pytest.raises(DeviceError, match="gave the frame from before the panel changed"):
            camera.expose(1.0)
    assert camera.expose(1.0)[0].max() == 3
    camera.expose(1.0)
    camera.changed("third")  # black
    assert camera.expose(1.0)[0].max() == 0


def test_a_camera_that_falls_behind_ends_the_run_since_its_later_frames_are_old_too():
    device, waiting = camera(noise=2.0), []
    taken, device.expose = device.expose, lambda seconds: (waiting.append(taken(seconds)), waiting.pop(0))[1]
    camera_ = FreshCamera(device)
    camera_.changed("first")
    waiting.append(camera_.expose(0.01))
    camera_.changed("second")
    with pytest.raises(LostDeviceError, match="frame 2 after an exposure was set is the first with it"):
        camera_.expose(0.01)


def test_a_driver_may_fill_one_buffer_again_and_a_dark_frame_may_repeat_with_its_hot_pixel():
    buffer = np.zeros((40, 40), np.uint16)
    device = SimulatedCamera(Still(np.ones((40, 40))))
    device.expose = lambda seconds: (buffer, seconds)
    camera = FreshCamera(device)
    for number in range(3):
        camera.changed(number)
        buffer[:, 0] = number
        assert camera.expose(1.0)[0][0, 0] == number
    buffer[:] = 0
    buffer[3, 5] = 900
    for number in range(3, 5):
        camera.changed(number)
        assert camera.expose(1.0)[0].max() == 900


def test_the_average_neither_clips_nor_rounds_and_a_sample_is_saturated_when_any_frame_is():
    device = camera(np.full((40, 40), 1.0), bits=16, gain=3e6, noise=3.0, dark=0.0)
    taken = averaged(device, 0.02, 64, 0)  # about 60,000 counts, whose sum no 16 bits hold
    assert taken.counts.dtype == np.float64
    assert abs(taken.counts.mean() - 60_000) < 0.5
    assert 0.2 < taken.counts.std() < 0.6  # 3 / sqrt(64)
    device = camera(np.full((50, 50), 1.0), noise=100.0, gain=4000.0)
    taken = averaged(device, 0.97, 16, 0)
    assert taken.saturated.mean() > 0.5
    assert taken.counts.max() < device.white


def test_dark_counts_are_subtracted_at_the_photographs_own_exposure_and_bright_ones_refused():
    """Raw counts below the dark level become negative light, not 65,000."""
    still = Still(speckle(0.05))
    device = SimulatedCamera(still, bits=16, dark=40.0, dark_rate=300.0, hot=30.0, noise=1.0)
    still.channel = None
    dark = dark_frames(device, 16, (0.01, 0.5), 0)
    still.channel = 0
    for seconds in (0.02, 0.1, 0.8):
        light, lost = combined([averaged(device, seconds, 4, 0)], dark)
        assert lost == 0
        assert abs(light.mean() - 1000 * speckle().mean()) < 0.02 * 1000 + 0.2 / seconds
    nothing, _ = combined([Averaged(np.array([[30.0]]), np.array([[False]]), 1.0)], given_dark(64.0)[0])
    assert nothing[0, 0] == -34.0
    with pytest.raises(DeviceError, match="is the laser really off"):
        dark_frames(camera(np.full((20, 20), 1.0)), 2, (0.01, 0.3), 0)


def test_a_bracket_measures_what_one_exposure_cannot():
    """Against the truth: dim samples about as exact as in the long exposure, bright ones as in the short."""
    picture = np.concatenate([speckle(0.02), speckle(3.0)], axis=1)
    device = camera(picture, noise=4.0)
    dark = Dark(np.array(64.0), np.array(0.0))
    long, short = averaged(device, 0.4, 4, 0), averaged(device, 0.4 / 64, 4, 0)
    both, lost = combined([long, short], dark)
    truth = picture * device.gain
    assert long.saturated.mean() > 0.3
    assert lost < 0.001
    dim = truth < 0.02 * device.gain
    error = (both - truth)[dim].std()
    assert error < 1.5 * (combined([long], dark)[0] - truth)[dim].std()
    assert error < 0.05 * (combined([short], dark)[0] - truth)[dim].std()
    bright = truth > 5 * device.gain
    assert np.abs(both / truth - 1)[bright & ~short.saturated].max() < 0.02


def test_samples_saturated_in_every_exposure_count_as_saturated():
    device = camera(np.pad(np.full((10, 10), 1e6), 20))
    bracket = [averaged(device, seconds, 1, 0) for seconds in (0.1, 0.01)]
    light, lost = combined(bracket, given_dark(64.0)[0])
    assert lost == pytest.approx(100 / 2500)
    assert np.isfinite(light).all()
    assert light[25, 25] == pytest.approx((4095 - 64) / 0.01)


def test_a_procedure_needs_dark_frames_or_a_dark_level_and_one_exposure_for_all_channels_or_one_for_each():
    assert CaptureSettings().exposures(3) is None
    assert CaptureSettings(exposure=0.1, dark_frames=0, dark=64.0).exposures(3) == (0.1, 0.1, 0.1)
    with pytest.raises(UserError, match="2 values, but the panel has 3"):
        CaptureSettings(exposure=(0.1, 0.2)).exposures(3)
    for wrong in ({"dark_frames": 0}, {"dark_frames": 4, "dark": 64.0}, {"dark": 8}):
        with pytest.raises(UserError, match="either dark frames"):
            CaptureSettings(**wrong)
    for wrong in ({"exposure": (0.1, 0.0)}, {"exposure": 1e9}, {"settle": -0.1}):
        with pytest.raises(UserError, match=rf"capture\.{next(iter(wrong))} should be auto, or"):
            CaptureSettings(**wrong)


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


def test_a_bench_that_never_settles_or_a_panel_that_the_camera_does_not_see_is_one_line():
    lines = {"lag": "1.5 s after holograms were shown do not follow them", "latency": "still changes 1 s after"}
    lines |= {"restless": "laser's power"}
    for fault, size in (("lag", 4.0), ("latency", 1.2), ("restless", 0.5)):
        with pytest.raises(DeviceError, match=lines[fault]) as error:
            settle_time(toggle(Scene(bench(), **{fault: size})))
        assert "\n" not in str(error.value)
    blind = toggle(Scene(bench()))
    same = Toggle(blind.show, lambda: np.full((30, 30), 200.0), blind.wait)
    with pytest.raises(DeviceError, match="is this the panel that the camera sees"):
        settle_time(same)


@pytest.mark.parametrize("queue", range(12))
@pytest.mark.parametrize("before", [0.0, 1.4, 9.0])
def test_frames_that_wait_in_a_queue_are_counted_whatever_they_show(queue, before):
    random, waiting = np.random.default_rng(0), [before * speckle()[:20, :20] for _ in range(queue)]

    def take(kind):
        waiting.append(speckle(1.0 + kind)[:20, :20] + random.normal(0, 0.1, (20, 20)))
        return waiting.pop(0)

    count, _ = late(take)
    assert count == queue or (count > WAITING and queue > WAITING)


def test_a_change_that_noise_hides_is_no_delay():
    random = np.random.default_rng(0)
    assert late(lambda kind: 0.01 * kind + random.normal(0, 1, (20, 20)))[0] is None


def test_an_exposure_that_a_camera_cannot_have_is_no_photograph():
    device = camera()
    device.expose, taken = lambda seconds: (taken(seconds)[0], 1e3 * seconds), device.expose  # milliseconds
    with pytest.raises(DeviceError, match=r"exposed for 500 s is no photograph; its exposures are 1e-05 to 10 s"):
        averaged(device, 0.5, 1, 0)


@pytest.mark.parametrize("bits", [8, 12, 16])
@pytest.mark.parametrize("level", [0.02, 0.2, 0.7, 3.0])
def test_counts_that_end_at_white_or_fall_off_below_it_are_right_and_those_cut_off_are_not(bits, level):
    white = 2**bits - 1
    random, light = np.random.default_rng(0), speckle(level / 7)
    frame = np.clip(np.round((light + 0.01) * white + random.normal(0, 1, light.shape)), 0, white).astype(np.uint16)
    frame[::30, ::30] = white  # hot

    def seen(far):
        dark = np.full_like(frame, 40 if np.ptp(far) == 0 else 0.01 * white)
        device = camera(bits=bits)
        device.expose = lambda seconds: (dark if seconds == device.exposures[0] else far, seconds)
        return refuse_miscounted(device, 0.01, 0)

    seen(frame)
    seen(np.full_like(frame, 40))
    cut = int(np.quantile(frame, 0.95))
    if white > cut > 0.01 * white + 15:
        for spoilt in (np.minimum(frame, cut), np.append(np.full_like(frame, cut), [[cut - 1] * frame.shape[1]], 0)):
            with pytest.raises(DeviceError, match=f"its counts end at {cut}.*, below its white of {white}"):
                seen(spoilt)
