"""A USB video camera: what it does of itself is off, or it is refused. Its controls are those of a stand-in."""

import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.lab.devices import DeviceError
from holobench_eval.lab.drivers.catalogue import adopted
from holobench_eval.lab.drivers.opencv_camera import STALE, OpencvCamera, OpencvSettings

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="V4L2's values of the controls")

SETTINGS = OpencvSettings(device="/dev/v4l/by-id/cam", resolution=(64, 48), exposures=(1e-3, 1.0))
AUTO = (cv2.CAP_PROP_AUTO_EXPOSURE, 3.0), (cv2.CAP_PROP_AUTO_WB, 1.0), (cv2.CAP_PROP_GAIN, 40.0)


class StandIn:
    """A ``cv2.VideoCapture`` of a camera: controls, those that do not move, and frames that were begun earlier."""

    def __init__(self, stuck: tuple[int, ...] = (), absent: tuple[int, ...] = (), frame: Any = None) -> None:
        self.controls: dict[int, float] = dict(AUTO) | {cv2.CAP_PROP_GAMMA: 220.0, cv2.CAP_PROP_SHARPNESS: 3.0}
        self.stuck, self.absent, self.released = stuck, absent, False
        self.frame = np.zeros((48, 64), np.uint8) if frame is None else frame
        self._waiting = [0] * STALE

    def isOpened(self) -> bool:  # noqa: N802
        return True

    def get(self, control: int) -> float:
        return -1.0 if control in self.absent else self.controls.get(control, -1.0)

    def set(self, control: int, value: float) -> bool:
        if control in self.absent:
            return False
        if control not in self.stuck:
            self.controls[control] = value
        return True

    def read(self) -> tuple[bool, np.ndarray]:
        self._waiting.append(int(self.controls[cv2.CAP_PROP_EXPOSURE]))
        return True, self.frame + min(self._waiting.pop(0), 200)

    def release(self) -> None:
        self.released = True


def test_whatever_a_camera_does_of_itself_is_switched_off_or_lacking() -> None:
    capture = StandIn()
    OpencvCamera(SETTINGS, capture).close()
    off = {cv2.CAP_PROP_AUTO_EXPOSURE: 1, cv2.CAP_PROP_AUTO_WB: 0, cv2.CAP_PROP_GAIN: 0, cv2.CAP_PROP_GAMMA: 100}
    assert {control: capture.controls[control] for control in off} == off
    assert capture.released
    lacking = cv2.CAP_PROP_AUTO_WB, cv2.CAP_PROP_GAIN, cv2.CAP_PROP_GAMMA, cv2.CAP_PROP_SHARPNESS
    OpencvCamera(SETTINGS, StandIn(absent=lacking)).close()
    with pytest.raises(UserError, match="auto exposure cannot be set"):
        OpencvCamera(SETTINGS, StandIn(absent=(cv2.CAP_PROP_AUTO_EXPOSURE,)))


@pytest.mark.parametrize(
    ("control", "what"),
    [
        (cv2.CAP_PROP_AUTO_EXPOSURE, r"auto exposure cannot be set to 1 \(it stays at 3\)"),
        (cv2.CAP_PROP_GAMMA, "gamma cannot be set to 100"),
        (cv2.CAP_PROP_SHARPNESS, "sharpness cannot be set to 0"),
    ],
)
def test_a_control_that_stays_on_is_refused(control: int, what: str) -> None:
    capture = StandIn(stuck=(control,))
    with pytest.raises(UserError, match=what):
        OpencvCamera(SETTINGS, capture)
    assert capture.released


def test_frames_that_were_begun_before_are_thrown_away_and_an_exposure_that_is_not_taken_is_told() -> None:
    camera = OpencvCamera(SETTINGS, StandIn())
    frames = [camera.expose(seconds) for seconds in (0.005, 0.015, 0.01)]
    assert [(frame.max(), real) for frame, real in frames] == [(50, 0.005), (150, 0.015), (100, 0.01)]
    capture = StandIn()
    camera = OpencvCamera(SETTINGS, capture)
    capture.controls[cv2.CAP_PROP_EXPOSURE] = 156.0
    capture.stuck = (cv2.CAP_PROP_EXPOSURE,)
    with pytest.raises(DeviceError, match="exposure stays at 156, not 100"):
        camera.expose(0.01)


@pytest.mark.parametrize(
    ("control", "value", "what"),
    [
        (cv2.CAP_PROP_FRAME_WIDTH, 640.0, "gives 640x48 pixels"),
        (cv2.CAP_PROP_FOURCC, float(cv2.VideoWriter.fourcc(*"MJPG")), "gives 'MJPG', not GREY"),
    ],
)
def test_another_resolution_or_format_is_refused(control: int, value: float, what: str) -> None:
    capture = StandIn(stuck=(control,))
    capture.controls[control] = value
    with pytest.raises(UserError, match=what):
        OpencvCamera(SETTINGS, capture)


def test_colour_comes_as_red_green_blue_and_sixteen_bits_with_their_white() -> None:
    blue_green_red = np.zeros((48, 64, 3), np.uint8) + np.uint8([3, 2, 1])
    colour = OpencvCamera(
        OpencvSettings("/dev/cam", (64, 48), (1e-4, 1.0), format="YUYV"), StandIn(frame=blue_green_red)
    )
    assert colour.expose(1e-4)[0][0, 0].tolist() == [2, 3, 4]
    deep = StandIn(frame=np.full((1, 48 * 64), 4000, np.uint16))
    settings = OpencvSettings("/dev/cam", (64, 48), (1e-4, 1.0), format="Y16", bits=12)
    grey = adopted("camera", OpencvCamera(settings, deep))
    assert (grey.expose(1e-4)[0].shape, grey.white) == ((48, 64), 4095)
    deep.frame = np.full((48, 64), 5000, np.uint16)
    with pytest.raises(DeviceError, match="5001 counts, but 4095 are its white"):
        grey.expose(1e-4)


def test_pictures_of_a_real_capture_come_unaltered_and_the_stale_ones_are_skipped(tmp_path: Path) -> None:
    """OpenCV's own reading of files without loss; only the controls are the stand-in's."""
    pictures = np.random.default_rng(2).integers(0, 256, (2 * (STALE + 1), 48, 64, 3), dtype=np.uint8)
    for number, picture in enumerate(pictures):
        cv2.imwrite(str(tmp_path / f"{number:03}.png"), picture[..., ::-1])
    files = cv2.VideoCapture(str(tmp_path / "%03d.png"))
    capture = StandIn()
    capture.read = files.read  # type: ignore[method-assign]
    camera = OpencvCamera(OpencvSettings("/dev/cam", (64, 48), (1e-4, 1.0), format="YUYV"), capture)
    for expected in (pictures[STALE], pictures[-1]):
        assert np.array_equal(camera.expose(0.01)[0], expected)
    with pytest.raises(DeviceError, match="gives no frame"):
        camera.expose(0.01)
    files.release()


def test_a_device_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="does not open; is it plugged in"):
        OpencvCamera(OpencvSettings(str(tmp_path / "video9"), (64, 48), (1e-3, 1.0)))
