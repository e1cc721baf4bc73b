"""libgphoto2's own virtual camera, which hands out the files of a folder whatever is in them."""

import os
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.lab.devices import DeviceError
from holobench_eval.lab.drivers.catalogue import open_device
from holobench_eval.lab.drivers.gphoto2_camera import Gphoto2Camera, Gphoto2Settings, list_cameras
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
            assert camera._worker.call("asking", 5, lambda: camera._value("shutterspeed")) == speed
        assert frame.dtype == np.uint16
        assert frame.shape == (32, 48, 3)
        assert np.array_equal(frame[..., 0], MOSAIC[::2, ::2])
    finally:
        camera.close()


def test_a_jpeg_is_refused_with_what_to_set(card: Callable[[bytes], None]) -> None:
    card(cv2.imencode(".jpg", np.zeros((480, 640, 3), np.uint8))[1].tobytes())
    with pytest.raises(UserError, match=rf"{MODEL} .*gave a JPEG, .* set its image quality to RAW alone"):
        Gphoto2Camera(Gphoto2Settings())


def test_a_damaged_file_is_a_failure_of_the_device(card: Callable[[bytes], None], raw: bytes) -> None:
    card(raw[:3000])
    with pytest.raises(DeviceError, match=r"a picture of .*: not a RAW file"):
        Gphoto2Camera(Gphoto2Settings())


def test_another_camera_is_refused_with_those_that_answer_and_so_is_a_sensitivity_that_it_lacks(raw: bytes) -> None:
    assert list_cameras() == [f"{MODEL} at usb:001,001"]
    with pytest.raises(UserError, match=f"no camera 'Canon EOS Rebel T6i'; found: {MODEL} at usb:001,001"):
        Gphoto2Camera(Gphoto2Settings(model="Canon EOS Rebel T6i"))
    with pytest.raises(UserError, match="no camera 'any'; found"):
        Gphoto2Camera(Gphoto2Settings(port="usb:001,009"))
    with pytest.raises(UserError, match="no fitting 'iso' among: nothing"):
        Gphoto2Camera(Gphoto2Settings(iso="100"))


@pytest.mark.parametrize(
    ("menu", "message"),
    [
        ({}, "does not let its shutter speed be set"),
        ({"shutterspeed": ("bulb", ["bulb"])}, "does not let its shutter speed be set"),
        ({"autoexposuremode": ("AV", ["AV", "Manual"])}, "stands on 'AV'.* turn its dial to M"),
        ({"iso": ("Auto", ["Auto", "100"])}, "sets its ISO by itself"),
    ],
)
def test_a_camera_that_decides_by_itself_is_refused(
    raw: bytes, monkeypatch: pytest.MonkeyPatch, menu: dict, message: str
) -> None:
    monkeypatch.setattr(Gphoto2Camera, "_value", lambda self, config: menu.get(config, ("", []))[0])
    monkeypatch.setattr(Gphoto2Camera, "_choices", lambda self, config: menu.get(config, ("", []))[1])
    with pytest.raises(UserError, match=message):
        Gphoto2Camera(Gphoto2Settings())


@pytest.mark.parametrize(
    ("choices", "chosen"),
    [
        (["Large Fine JPEG", "RAW + Large Fine JPEG", "mRAW", "RAW"], "RAW"),
        (["JPEG Basic", "NEF+Basic", "NEF (Raw)"], "NEF (Raw)"),
        (["cRAW", "RAW"], "RAW"),
    ],
)
def test_the_full_raw_alone_is_chosen(
    raw: bytes, monkeypatch: pytest.MonkeyPatch, choices: list[str], chosen: str
) -> None:
    taken: list[str] = []

    def choose(self: Gphoto2Camera, config: str, fits: Callable[[str], bool]) -> None:
        taken.extend(choice for choice in choices if config == "imageformat" and fits(choice))

    known = Gphoto2Camera._choices
    monkeypatch.setattr(
        Gphoto2Camera, "_choices", lambda self, config: choices if config == "imageformat" else known(self, config)
    )
    monkeypatch.setattr(Gphoto2Camera, "_choose", choose)
    with pytest.raises(DeviceError, match="shutter speed stays"):  # as nothing is set any more
        Gphoto2Camera(Gphoto2Settings()).expose(1.0)
    assert taken == [chosen]
