"""Cameras of the USB video class through OpenCV (driver ``opencv``): a last resort, since most of them help too much.

Whatever a camera does of itself is switched off and read back, and a camera that cannot be made to stop is refused.
That the counts that are left are linear is shown by the linearity gate, by nothing else.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Interval, MinLen

from ...core.errors import UserError
from ..devices import Counts, DeviceError
from .driver import Driver
from .worker import closed_on_failure

STALE = 5  # frames that a driver may hold back although it is asked for one
ABSENT = (-1.0,)  # what OpenCV says of a control that the driver does not have

Seconds = Annotated[float, Interval(gt=0, le=60)]
Side = Annotated[int, Interval(ge=1, le=32768)]


@dataclass(frozen=True)
class OpencvSettings:
    """Which camera, in which format, and the values at which it does nothing of itself.

    device: ``/dev/v4l/by-id/...`` on Linux, whose numbers change from start to start, or a number elsewhere;
    resolution: columns and rows, which must be those of the sensor, lest it scales; format: ``GREY`` (8 bit), ``Y16``
    (up to 16 bit) or ``YUYV`` (8 bit colour); bits: of a Y16 sample; exposures: shortest and longest [s];
    gain, gamma: the values that mean none, for most cameras 0 and 100.
    """

    device: Annotated[str, MinLen(1)] | Annotated[int, Interval(ge=0)]
    resolution: tuple[Side, Side]
    exposures: tuple[Seconds, Seconds]
    format: Literal["GREY", "Y16", "YUYV"] = "GREY"
    bits: Annotated[int, Interval(ge=8, le=16)] = 8
    gain: float = 0.0
    gamma: float = 100.0

    def __post_init__(self) -> None:
        if self.format != "Y16" and self.bits != 8:
            raise UserError(f"driver 'opencv': {self.format} has 8 bits, not {self.bits}")
        if self.exposures[0] >= self.exposures[1]:
            raise UserError("driver 'opencv': exposures are the shortest and the longest, in this order")


class OpencvCamera:
    """A USB video camera as a device that `Own` takes; colour frames come as red, green, blue."""

    def __init__(self, settings: OpencvSettings, capture: Any = None) -> None:
        """capture: an open ``cv2.VideoCapture`` or what stands for one; without it the device is opened.

        UserError: it does not open, has another resolution or format, or something of it cannot be switched off.
        """
        self.name = f"camera {settings.device}"
        self.exposures = settings.exposures
        self.white = float(2**settings.bits - 1)
        self._settings = settings
        self._capture = capture
        with closed_on_failure(self.close):
            self._open()

    def close(self) -> None:
        """Give the camera back."""
        if self._capture:
            self._capture.release()

    def _open(self) -> None:
        import cv2

        settings = self._settings
        if self._capture is None:
            self._capture = cv2.VideoCapture(settings.device, cv2.CAP_V4L2)
        if not self._capture.isOpened():
            raise UserError(f"{self.name} does not open; is it plugged in, and not in use?")
        self._name_format(cv2)
        # from the control that drives the others to those that it would drive
        self._switch("auto exposure", cv2.CAP_PROP_AUTO_EXPOSURE, 1.0, optional=False)  # V4L2's word for manual
        self._switch("auto white balance", cv2.CAP_PROP_AUTO_WB, 0.0)
        self._switch("gain", cv2.CAP_PROP_GAIN, settings.gain)
        self._switch("gamma", cv2.CAP_PROP_GAMMA, settings.gamma)
        self._switch("sharpness", cv2.CAP_PROP_SHARPNESS, 0.0)
        self._switch("backlight compensation", cv2.CAP_PROP_BACKLIGHT, 0.0)
        self._capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)

    def _name_format(self, cv2: Any) -> None:
        settings, capture = self._settings, self._capture
        code = cv2.VideoWriter.fourcc(*f"{settings.format:4}")
        capture.set(cv2.CAP_PROP_FOURCC, code)
        capture.set(cv2.CAP_PROP_CONVERT_RGB, 1.0 if settings.format == "YUYV" else 0.0)
        for axis, side in zip((cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT), settings.resolution, strict=True):
            capture.set(axis, side)
        got = int(capture.get(cv2.CAP_PROP_FOURCC)) & 0xFFFFFFFF
        if got != code:
            letters = got.to_bytes(4, "little").decode("ascii", "replace").strip()
            raise UserError(f"{self.name} gives {letters!r}, not {settings.format}; see v4l2-ctl --list-formats")
        sides = tuple(int(capture.get(axis)) for axis in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
        if sides != settings.resolution:
            raise UserError(f"{self.name} gives {sides[0]}x{sides[1]} pixels, not {settings.resolution}")

    def _switch(self, what: str, control: int, value: float, *, optional: bool = True) -> None:
        capture = self._capture
        if capture.get(control) in ABSENT and optional:
            return
        taken = capture.set(control, value)
        kept = capture.get(control)
        if not taken or not math.isclose(kept, value, abs_tol=1e-6):
            raise UserError(
                f"{self.name}: its {what} cannot be set to {value:g} (it stays at {kept:g}); take another camera, or a "
                "driver of its maker's"
            )

    def expose(self, seconds: float) -> tuple[Counts, float]:
        """A frame after some that are thrown away, since the driver had begun them before, and its exposure [s]."""
        import cv2

        capture = self._capture
        value = float(max(round(seconds * 1e4), 1))  # V4L2 counts in 100 us
        if not capture.set(cv2.CAP_PROP_EXPOSURE, value) or capture.get(cv2.CAP_PROP_EXPOSURE) != value:
            kept = capture.get(cv2.CAP_PROP_EXPOSURE)
            raise DeviceError(f"{self.name}: the exposure stays at {kept:g}, not {value:g}")
        for _ in range(STALE):
            capture.read()
        good, frame = capture.read()
        if not good or frame is None:
            raise DeviceError(f"{self.name} gives no frame")
        columns, rows = self._settings.resolution
        if self._settings.format == "YUYV":
            frame = frame[..., ::-1]
        elif frame.size == rows * columns:  # OpenCV gives what it does not convert with an axis too many, or as bytes
            frame = frame.reshape(rows, columns)
        kind = np.uint16 if self._settings.format == "Y16" else np.uint8
        if frame.dtype != kind or frame.shape not in ((rows, columns), (rows, columns, 3)):
            raise DeviceError(f"{self.name} gave a {frame.dtype} frame of {frame.shape}, not {kind.__name__}")
        return np.ascontiguousarray(frame), value / 1e4


def list_cameras() -> list[str]:
    """The video devices of this computer, as far as it has names for them (Linux)."""
    return sorted(str(link) for link in Path("/dev/v4l/by-id").glob("*"))


DRIVERS = (Driver("camera", "opencv", OpencvSettings, OpencvCamera, "opencv-python-headless", "", list_cameras),)
