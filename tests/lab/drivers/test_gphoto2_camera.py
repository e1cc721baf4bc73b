"""libgphoto2's own virtual camera, which hands out the files of a folder whatever is in them."""

import math
import os
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.lab.devices import DeviceError
from holobench_eval.lab.drivers import gphoto2_camera as driver
from holobench_eval.lab.drivers.catalogue import open_device
from tests.support.bayer import bayer_dng

MOSAIC = np.random.default_rng(4).integers(0, 16383, (64, 96), dtype=np.uint16)
MODEL = "Nikon DSC D750"  # which the virtual camera claims to be


@pytest.fixture
def card(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[bytes], object]:
    """Puts a file into the virtual camera; it hands out names that end in .jpg only."""
    pytest.importorskip("rawpy")
    monkeypatch.setenv("VCAMERADIR", str(tmp_path))  # seen by the package where it is imported for the first time
    gphoto2 = pytest.importorskip("gphoto2")
    monkeypatch.setenv("IOLIBS", str(Path(gphoto2.__file__).parent / "libgphoto2" / "vusb"))
    if not Path(os.environ["IOLIBS"]).is_dir():
        pytest.skip("this build of gphoto2 has no virtual camera")
    return lambda data: (tmp_path / "picture.jpg").write_bytes(data)


@pytest.fixture
def raw(card: Callable[[bytes], None]) -> bytes:
    """A RAW file in the virtual camera."""
    data = bayer_dng(MOSAIC)
    card(data)
    return data


def test_counts_of_the_photosites_arrive_at_the_nearest_speed_whose_time_is_told(raw: bytes) -> None:
    camera = open_device("camera", "gphoto2", {"model": MODEL})
    try:
        assert camera.name.startswith(MODEL)
        assert camera.white == 16383
        assert camera.exposures == pytest.approx((1e-4, 1.0), rel=0.1)
        for wanted, speed in ((0.12, "0.1000s"), (0.004, "0.0050s"), (60, "1.0000s")):
            frame, real = camera.expose(wanted)
            assert real == pytest.approx(float(speed[:-1]), rel=0.1)
            assert camera._device._value("shutterspeed") == speed
        assert frame.dtype == np.uint16
        assert frame.shape == (32, 48, 3)
        assert np.array_equal(frame[..., 0], MOSAIC[::2, ::2])
    finally:
        camera.close()


def test_a_jpeg_is_refused_with_what_to_set(card: Callable[[bytes], None]) -> None:
    card(cv2.imencode(".jpg", np.zeros((480, 640, 3), np.uint8))[1].tobytes())
    with pytest.raises(UserError, match=rf"{MODEL} .*gave a JPEG, .* set its image quality to RAW alone"):
        driver.Gphoto2Camera(driver.Gphoto2Settings())


def test_a_damaged_file_is_a_failure_of_the_device(card: Callable[[bytes], None], raw: bytes) -> None:
    card(raw[:3000])
    with pytest.raises(DeviceError, match=r"a picture of .*: not a RAW file"):
        driver.Gphoto2Camera(driver.Gphoto2Settings())


def test_another_camera_is_refused_with_those_that_answer_and_so_is_a_sensitivity_that_it_lacks(raw: bytes) -> None:
    assert driver.list_cameras() == [f"{MODEL} at usb:001,001"]
    with pytest.raises(UserError, match=f"no camera 'Canon EOS Rebel T6i'; found: {MODEL} at usb:001,001"):
        driver.Gphoto2Camera(driver.Gphoto2Settings(model="Canon EOS Rebel T6i"))
    with pytest.raises(UserError, match="no camera 'any'; found"):
        driver.Gphoto2Camera(driver.Gphoto2Settings(port="usb:001,009"))
    with pytest.raises(UserError, match="no fitting 'iso' among: nothing"):
        driver.Gphoto2Camera(driver.Gphoto2Settings(iso="100"))


@pytest.mark.parametrize(
    ("menu", "message"),
    [
        ({}, "does not let its shutter speed be set"),
        ({"shutterspeed": ("bulb", ["bulb"])}, "does not let its shutter speed be set"),
        ({"autoexposuremode": ("AV", ["AV", "Manual"])}, "stands on 'AV'.* turn its dial to M"),
        ({"iso": ("Auto", ["Auto", "100"])}, "sets its ISO by itself"),
    ],
)
def test_a_camera_that_decides_by_itself_is_refused(raw: bytes, monkeypatch, menu: dict, message: str) -> None:
    monkeypatch.setattr(driver.Gphoto2Camera, "_value", lambda self, config: menu.get(config, ("", []))[0])
    monkeypatch.setattr(driver.Gphoto2Camera, "_choices", lambda self, config: menu.get(config, ("", []))[1])
    with pytest.raises(UserError, match=message):
        driver.Gphoto2Camera(driver.Gphoto2Settings())


@pytest.mark.parametrize(
    ("choices", "chosen"),
    [
        (["Large Fine JPEG", "RAW + Large Fine JPEG", "mRAW", "RAW"], "RAW"),
        (["JPEG Basic", "NEF+Basic", "NEF (Raw)"], "NEF (Raw)"),
        (["cRAW", "RAW"], "RAW"),
    ],
)
def test_the_full_raw_alone_is_chosen(raw: bytes, monkeypatch, choices: list[str], chosen: str) -> None:
    taken: list[str] = []

    def choose(self: driver.Gphoto2Camera, config: str, fits: Callable[[str], bool]) -> None:
        taken.extend(choice for choice in choices if config == "imageformat" and fits(choice))

    known = driver.Gphoto2Camera._choices
    monkeypatch.setattr(
        driver.Gphoto2Camera,
        "_choices",
        lambda self, config: choices if config == "imageformat" else known(self, config),
    )
    monkeypatch.setattr(driver.Gphoto2Camera, "_choose", choose)
    with pytest.raises(DeviceError, match="shutter speed stays"):  # as nothing is set any more
        driver.Gphoto2Camera(driver.Gphoto2Settings()).expose(1.0)
    assert taken == [chosen]


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
    assert driver.seconds(text) == (time if time is None else pytest.approx(time))


def test_what_is_no_time_is_left_out_the_rest_is_sorted_and_the_nearest_is_so_by_ratio() -> None:
    assert list(driver.speeds(["bulb", "30", "1/125", "0.5", "auto"]).values()) == ["1/125", "0.5", "30"]
    assert driver.nearest([0.01, 0.1], 0.04) == 0.1


@pytest.mark.parametrize(("listed", "parts"), [(THIRDS, 3), (HALVES, 2)])
def test_written_times_become_exact_stops(listed: str, parts: int) -> None:
    times = driver.exact(driver.speeds(listed.split()))
    assert (times[1 / 60], times[30], times[1 / 125]) == (1 / 64, 32, 1 / 128)
    steps = sorted(math.log2(time) * parts for time in times.values())
    assert len(set(steps)) == len(times)
    assert all(step == pytest.approx(round(step)) for step in steps)


def test_a_list_of_other_times_is_taken_at_its_word() -> None:
    times = [milliseconds / 1000 for milliseconds in range(1, 40)]
    assert driver.exact(times) == {time: time for time in times}
