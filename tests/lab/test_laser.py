import os
import sys

import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.lab.devices import DeviceError
from holobench_eval.lab.laser import LaserSettings, laser

RECORD = "import sys; open('log', 'a').write(sys.argv[1] + ' ')"


def silent(line):
    raise AssertionError(line)


def test_a_command_runs_without_a_shell_for_every_channel(tmp_path):
    source = laser(
        LaserSettings(command=(sys.executable, "-c", RECORD, "laser={channel}; ls $HOME")), 3, tmp_path, silent
    )
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
        (LaserSettings(callable="laser"), 3, "should be path/to/file.py:function"),
        (LaserSettings(callable="none.py:switch"), 3, "cannot be imported"),
        (LaserSettings(callable="math:switch"), 3, "no function 'switch' in math"),
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
