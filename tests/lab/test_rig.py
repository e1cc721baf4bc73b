import os
import sys

import numpy as np
import pytest
import torch

from holobench_eval.core.errors import CellError, LostDeviceError, UserError
from holobench_eval.imaging.convention import Convention
from holobench_eval.lab.bench_file import CaptureSettings
from holobench_eval.lab.devices import DeviceError
from holobench_eval.lab.laser import LaserSettings, SteadyLaser, laser
from holobench_eval.lab.photograph import Request, plane_of
from holobench_eval.lab.rig import Rig
from tests.support.simulated_devices import GREEN, FastSlm, Scene, SimulatedCamera, SimulatedSlm, bench, pattern_phase

FAST = CaptureSettings(average=1, dark_frames=2)


def rig(procedure=FAST, convention=None, truth=None, channels=(GREEN,), **camera):
    scene = Scene(bench(), **(truth or {}))
    wavelengths = [bench().spec.wavelengths[channel] for channel in channels]
    laser = Lasers(scene, channels)
    bench_rig = Rig(
        SimulatedSlm(scene),
        SimulatedCamera(scene, **{"noise": 2.0, **camera}),
        convention or Convention(),
        procedure,
        wavelengths,
        laser,
        wait=scene.clock.wait,
    )
    bench_rig.scene = scene
    return bench_rig


class Lasers:
    """The rig counts channels from 0; the scene by the bench's wavelengths."""

    def __init__(self, scene, channels):
        self.scene, self.channels = scene, channels

    def select(self, channel):
        self.scene.select(None if channel is None else self.channels[channel])

    def close(self):
        self.select(None)


def asked(phase=None, relative=1.0):
    return Request(pattern_phase()[GREEN : GREEN + 1] if phase is None else phase, relative, "hologram", ())


def quiet(line):
    pass


def truth(bench_rig, phase):
    return bench_rig.scene.settled(Convention().levels(phase))


def test_preparing_says_one_line_for_each_step_in_order_and_closing_turns_the_lasers_off():
    bench_rig, lines = rig(channels=(0, 1, 2)), []
    ready = bench_rig.prepare(asked(pattern_phase()), lines.append)
    steps = ["exposure", "settling", "dark", "channel 0", "channel 1", "channel 2", "phase convention"]
    assert [line.split(":")[0] for line in lines] == [*steps, "phase.two_pi_level"]
    assert all("\n" not in line for line in lines)
    assert len(ready.exposures) == len(ready.darks) == 3
    bench_rig.close()
    assert bench_rig.scene.selected[-1] is None


def test_photographs_are_light_per_second_of_the_channels_own_laser():
    bench_rig = rig(
        CaptureSettings(average=4, dark_frames=4),
        truth={"latency": 0.03, "lag": 0.01},
        channels=(0, 1, 2),
        colour=True,
        dark_rate=40.0,
        hot=15.0,
    )
    bench_rig.prepare(asked(pattern_phase()), quiet)
    assert bench_rig.prepared.settle > 0.06
    phase = pattern_phase().roll(17, -1)
    for relative in (1.0, 0.4):
        taken = bench_rig.photograph(asked(phase, relative))
        assert taken.light.dtype == torch.float32
        assert taken.saturated < 0.001
        for channel, seen in enumerate(taken.light.double().numpy()):
            bench_rig.scene.channel = channel
            expected = truth(bench_rig, phase[channel]) * bench_rig.camera.gain
            assert np.corrcoef(seen.ravel(), expected.ravel())[0, 1] > 0.999
            assert abs(seen.mean() / expected.mean() - 1) < 0.02
            assert taken.exposure[channel] == pytest.approx(relative * bench_rig.prepared.exposures[channel])


def test_frames_share_a_photograph_on_a_panel_that_shows_sequences_and_no_other_takes_them():
    bench_rig = rig()
    bench_rig.prepare(asked(), quiet)
    phase = asked().phase
    frames = torch.stack([phase, phase.roll(17, -1), -phase])
    with pytest.raises(CellError, match="simulated panel shows one pattern an exposure, not 3 frames"):
        bench_rig.photograph(asked(frames))
    bench_rig.slm, before = FastSlm(bench_rig.scene), bench_rig.camera.frames
    taken = bench_rig.photograph(asked(frames))
    assert bench_rig.camera.frames == before + 1
    expected = np.mean([truth(bench_rig, frame[0]) for frame in frames], axis=0) * bench_rig.camera.gain
    assert np.corrcoef(taken.light[0].numpy().ravel(), expected.ravel())[0, 1] > 0.999
    assert float(taken.light.mean()) == pytest.approx(expected.mean(), rel=0.02)
    bench_rig.prepare(asked(), quiet)
    for shape in ((1, 64, 64), (3, 128, 128), (128, 128)):
        with pytest.raises(CellError, match=r"simulated panel with its wavelengths shows \(1, 128, 128\)"):
            bench_rig.photograph(asked(torch.zeros(shape)))
    with pytest.raises(CellError, match="no finite real numbers"):
        bench_rig.photograph(asked(torch.full((1, 128, 128), torch.nan)))


def test_a_bracket_measures_a_picture_that_saturates_one_exposure():
    bench_rig = rig(CaptureSettings(exposure=0.02, average=1, dark_frames=2, settle=0.0, hdr=(1.0, 0.1)), noise=1.0)
    bench_rig.prepare(asked(), quiet)
    taken = bench_rig.photograph(asked(relative=8.0))
    expected = truth(bench_rig, asked().phase[0]) * bench_rig.camera.gain
    assert expected.max() * 0.16 > 2 * bench_rig.camera.white
    assert taken.saturated == 0
    assert np.abs(taken.light[0].numpy() - expected).max() < 0.02 * expected.max()


def test_a_wrong_sign_or_a_bent_camera_ends_the_preparation_in_one_line():
    for settings, line in (({"truth": {"sign": -1}}, "set phase.sign: -1"), ({"gamma": 0.5}, "is there gamma")):
        bench_rig = rig(**settings)
        with pytest.raises(UserError, match=line) as error:
            bench_rig.prepare(asked(), quiet)
        assert "\n" not in str(error.value)
        with pytest.raises(UserError, match="before it has been prepared"):
            bench_rig.photograph(asked())


def test_what_is_set_is_not_measured():
    bench_rig = rig(CaptureSettings(exposure=0.01, average=1, dark_frames=0, dark=64.0, settle=0.25))
    lines = []
    ready = bench_rig.prepare(asked(), lines.append)
    assert ready.exposures == (0.01,)
    assert ready.settle == 0.25
    assert None not in bench_rig.scene.selected
    assert lines[1:3] == ["settling: 250 ms (as set)", "dark: 64.0 counts (as set)"]


def test_what_does_not_fit_the_camera_ends_the_preparation(tmp_path):
    np.save(tmp_path / "dark.npy", np.full((4, 4), 20, np.uint8))
    for settings, line in (
        ({"exposure": 0.2, "average": 1, "dark_frames": 2}, r"saturated; shorten capture\.exposure"),
        ({"exposure": 0.01, "dark_frames": 0, "dark": str(tmp_path / "dark.npy")}, "8 bits and the photograph 16"),
    ):
        with pytest.raises(UserError, match=line):
            rig(CaptureSettings(**settings, settle=0.0)).prepare(asked(), quiet)


def test_exposures_are_relative_to_those_of_the_letter_divided_by_its_own():
    plain, double = rig(), rig()
    one, two = plain.prepare(asked(), quiet), double.prepare(asked(relative=2.0), quiet)
    assert two.exposures[0] == pytest.approx(one.exposures[0] / 2, rel=0.05)
    assert double.photograph(asked(relative=2.0)).exposure[0] == pytest.approx(one.exposures[0], rel=0.05)


def test_a_dropped_frame_is_taken_again_a_device_that_fails_costs_a_cell_and_one_that_is_gone_ends_the_run():
    bench_rig = rig()
    bench_rig.prepare(asked(), quiet)
    bench_rig.camera.failures = 1
    before = bench_rig.slm.shown
    assert bench_rig.photograph(asked()).light.isfinite().all()
    assert bench_rig.slm.shown == before + 2  # the hologram too, since nobody knows what the panel shows
    bench_rig.slm.failures = 2
    with pytest.raises(CellError, match="no photograph: simulated panel: not connected"):
        bench_rig.photograph(asked())
    bench_rig.photograph(asked())
    bench_rig.slm.failures = 4
    with pytest.raises(CellError, match="no photograph"):
        bench_rig.photograph(asked())
    with pytest.raises(LostDeviceError, match="panel: not connected; mend it, and run again with --retry-failed"):
        bench_rig.photograph(asked())
    bench_rig.photograph(asked())
    bench_rig.camera.failures = 1000
    with pytest.raises(LostDeviceError, match="does not answer any more: simulated camera: no frame") as error:
        bench_rig.photograph(asked())
    assert "\n" not in str(error.value)
    with pytest.raises(UserError, match="the bench is not ready: simulated camera: no frame"):
        bench_rig.prepare(asked(), quiet)


def test_without_a_switch_the_user_is_asked_to_block_the_beam_once_each_way():
    bench_rig, heard = rig(), []

    def ask(line):
        heard.append(line)
        bench_rig.scene.select(None if line.startswith("block") else GREEN)

    bench_rig.laser = SteadyLaser(ask)
    bench_rig.scene.select(GREEN)
    bench_rig.prepare(asked(), quiet)
    bench_rig.close()
    assert heard == ["block the laser beam", "open the laser beam again"]


def test_a_colour_cameras_plane_follows_the_wavelength():
    assert [plane_of(nm * 1e-9) for nm in (638, 593, 532, 517, 488, 450)] == [0, 0, 1, 1, 2, 2]


def test_each_laser_is_shown_the_levels_of_its_own_full_turn_with_the_map():
    turns = np.random.default_rng(0).random((3, *bench().spec.shape))
    convention = Convention(two_pi_level=(311.0, 256.0, 221.0), turns=turns)
    bench_rig, phase = rig(convention=convention, channels=(0, 1, 2)), pattern_phase()
    for channel, levels in enumerate(convention.levels(phase)):
        bench_rig._show(phase, channel, convention, 0.0)
        assert np.array_equal(bench_rig.scene.history[-1][1], levels)


RECORD = "import sys; open('log', 'a').write(sys.argv[1] + ' ')"


def silent(line):
    raise AssertionError(line)


def test_a_command_runs_without_a_shell_for_every_channel(tmp_path):
    command = (sys.executable, "-c", RECORD, "laser={channel}; ls $HOME")
    source = laser(LaserSettings(command=command), 3, tmp_path, silent)
    for channel in (0, 2, None):
        source.select(channel)
    source.close()
    expected = [f"laser={word}; ls $HOME " for word in ("0", "2", "off", "off")]
    assert (tmp_path / "log").read_text() == "".join(expected)


@pytest.mark.parametrize(
    ("command", "line"),
    [
        ((sys.executable, "-c", "import sys; print('no key', file=sys.stderr); sys.exit(3)"), "3 .*: no key"),
        ((sys.executable, "-c", "import time; time.sleep(60)"), "longer than 0.5 s"),
        (("/nowhere/laser",), "does not run"),
    ],
)
def test_a_command_that_fails_is_a_device_error(tmp_path, command, line):
    source = laser(LaserSettings(command=(*command, "{channel}"), timeout=0.5), 3, tmp_path, silent)
    with pytest.raises(DeviceError, match=line) as error:
        source.select(0)
    assert "\n" not in str(error.value)


def test_a_function_of_a_file_gets_the_channel_or_none_and_what_it_raises_is_a_device_error(tmp_path):
    text = (
        "seen = []\ndef switch(channel):\n    seen.append(channel)\n    if channel == 2: raise ValueError('no port')\n"
    )
    (tmp_path / "mine.py").write_text(text)
    source = laser(LaserSettings(callable="mine.py:switch"), 3, tmp_path, silent)
    source.select(1)
    with pytest.raises(DeviceError, match="ValueError: no port"):
        source.select(2)
    source.close()
    assert source.function.__globals__["seen"] == [1, 2, None]


@pytest.mark.parametrize(
    ("settings", "channels", "line"),
    [
        (None, 3, "3 wavelengths need"),
        (LaserSettings(), 3, "either 'command' or 'callable'"),
        (LaserSettings(command=("a", "{channel}"), callable="b:c"), 3, "either"),
        (LaserSettings(command=("laser", "on")), 3, "must hold {channel}"),
        (LaserSettings(callable="laser"), 3, "should be path/to/file.py:Name"),
        (LaserSettings(callable="none.py:switch"), 3, "cannot be imported"),
        (LaserSettings(callable="math:switch"), 3, "'switch' of math is not there"),
    ],
)
def test_settings_that_cannot_work_are_one_line(tmp_path, settings, channels, line):
    with pytest.raises(UserError, match=line):
        laser(settings, channels, tmp_path, silent)


def test_a_laser_that_nobody_can_switch_is_blocked_by_the_user_only_when_needed(tmp_path):
    asked = []
    source = laser(None, 1, tmp_path, asked.append)
    for channel in (0, 0, None, None, 0, 0):
        source.select(channel)
    source.close()
    assert asked == ["block the laser beam", "open the laser beam again"]


def test_a_function_that_was_edited_is_imported_again_and_never_from_bytecode(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    file = tmp_path / "mine.py"
    for number in (1, 2):  # equal size and equal time, which is all that bytecode is checked by
        file.write_text(f"def switch(channel):\n    return {number}\n")
        os.utime(file, (1e9, 1e9))
        assert laser(LaserSettings(callable="mine.py:switch"), 3, tmp_path, silent).function(0) == number
