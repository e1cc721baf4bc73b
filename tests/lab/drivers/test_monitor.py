"""The second monitor, on a real X server: matched by name, shown pixel for pixel, and told when it is not."""

from collections.abc import Iterator
from types import SimpleNamespace

import numpy as np
import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.lab.devices import DeviceError
from holobench_eval.lab.drivers.catalogue import open_device
from holobench_eval.lab.drivers.monitor import MonitorSettings, list_monitors, matching
from holobench_eval.lab.drivers.own import Own
from tests.support.benches.two_monitors import PANEL, PANEL_AT, Eyes, two_monitors

SHAPE = (1080, 1920)


@pytest.fixture(scope="module")
def desktop() -> Iterator[str]:
    pytest.importorskip("pyglet")
    with two_monitors() as name, pytest.MonkeyPatch.context() as patch:
        patch.setenv("DISPLAY", name)
        yield name


@pytest.fixture(scope="module")
def slm(desktop: str) -> Iterator[Own]:
    slm = open_device("slm", "monitor", PANEL)
    yield slm
    slm.close()


@pytest.fixture(scope="module")
def eyes(desktop: str) -> Iterator[Eyes]:
    eyes = Eyes(desktop)
    yield eyes
    eyes.close()


def every_level() -> np.ndarray:
    """All 256 levels in every row and every column, none beside itself, the first row and column told apart."""
    rows, columns = np.indices(SHAPE)
    return ((rows * 7 + columns * 5 + (rows * columns) % 3) % 256).astype(np.uint8)


def test_every_level_of_every_pixel_is_at_once_what_another_program_sees(slm: Own, eyes: Eyes) -> None:
    levels = every_level()
    assert np.array_equal(np.unique(levels), np.arange(256))
    for picture in (levels, np.random.default_rng(1).integers(0, 256, SHAPE, dtype=np.uint8)):
        slm.show(picture)
        assert np.array_equal(eyes.panel(), np.repeat(picture[..., None], 3, axis=2))


def test_the_pointer_is_invisible_on_the_panel_and_a_notice_or_a_bent_gamma_curve_is_told(slm, eyes) -> None:
    levels = every_level()
    slm.show(levels)
    eyes.move_pointer(500, 300)
    assert eyes.pointer_is_visible()
    eyes.move_pointer(PANEL_AT[0] + 300, 300)
    assert not eyes.pointer_is_visible()
    assert np.array_equal(eyes.panel()[..., 0], levels)
    with (
        eyes.notice(),
        pytest.raises(DeviceError, match=r"screen does not show the picture: \d+ of 2073600.* row 900, "),
    ):
        slm.show(levels)
    slm.show(levels)
    with eyes.bent_curve(), pytest.raises(DeviceError, match="gamma curve is bent"):
        slm.show(levels)
    slm.show(levels)


def test_levels_of_another_shape_or_type_are_never_converted(slm: Own) -> None:
    with pytest.raises(DeviceError, match="takes uint8 levels"):
        slm.show(np.zeros((1080, 1919), np.uint8))
    with pytest.raises(DeviceError, match="takes uint8 levels"):
        slm.show(np.zeros(SHAPE, np.float32))


@pytest.mark.parametrize("asked", [{"name": "HDMI-1"}, {"resolution": (1024, 768)}])
def test_another_name_or_resolution_is_refused_with_what_was_found(desktop: str, asked: dict) -> None:
    assert list_monitors() == ["DUMMY0 1024x768", "DUMMY1 1920x1080"]
    with pytest.raises(UserError, match=r"no monitor '.*'; found: DUMMY0 1024x768, DUMMY1 1920x1080"):
        open_device("slm", "monitor", {**PANEL, **asked})


def test_two_monitors_of_one_name_or_no_desktop_are_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    twin = SimpleNamespace(get_monitor_name=lambda: "HOLOEYE", width=1920, height=1080)
    with pytest.raises(UserError, match="2 monitors 'holoeye 1920x1080'; found: HOLOEYE 1920x1080, HOLOEYE"):
        matching([twin, twin], MonitorSettings("holoeye", (1920, 1080)))
    pytest.importorskip("pyglet")
    monkeypatch.setenv("DISPLAY", ":4242")
    with pytest.raises(UserError, match="no desktop"):
        list_monitors()


def test_a_closed_panel_says_so_and_closing_again_does_nothing(desktop: str) -> None:
    slm = open_device("slm", "monitor", {"name": "DUMMY0", "resolution": [1024, 768], "check": "framebuffer"})
    slm.show(np.zeros((768, 1024), np.uint8))
    slm.close()
    slm.close()
    with pytest.raises(DeviceError, match="is closed"):
        slm.show(np.zeros((768, 1024), np.uint8))
