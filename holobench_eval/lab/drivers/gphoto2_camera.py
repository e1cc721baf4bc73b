"""Cameras with lenses, by libgphoto2 (driver ``gphoto2``, extra ``[gphoto2]``): RAW files only, times of the shutter.

A DSLR on Live View or JPEG gives pictures for people: curved, balanced, sharpened. Only its RAW counts light.
"""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from statistics import fmean
from typing import Any

import numpy as np

from ...core.errors import UserError
from ..devices import Counts, DeviceError
from ..raw import RawFrame, is_jpeg, read_raw
from .driver import Driver, import_package, only
from .worker import asked, closed_on_failure

LOOKING = 30.0  # seconds

FORMATS = ("imageformat", "imagequality", "imgquality")  # Canon, Nikon and Sony, others
FULL_RAW = re.compile(r"\b(raw|nef|dng|arw|orf|raf|pef|rw2)\b", re.IGNORECASE)
LESS_THAN_RAW = re.compile(r"\+|jpe?g|fine|normal|basic|large|small|medium|craw|[sm]-?raw|s\d", re.IGNORECASE)
MODES = ("autoexposuremode", "expprogram")
FRACTION = re.compile(r"(\d+(?:\.\d+)?)\s*/\s*(\d+(?:\.\d+)?)")
QUOTED = re.compile(r"(\d+)\"(\d+)?")  # 1"3 is 1.3 s
LARGEST_SPREAD = 0.2  # of a step: cameras that write 1/60 and 0.3 have 0.06 to 0.18, any times at all have 0.29
PLAIN = re.compile(r"(\d+(?:[.,]\d+)?)")


@dataclass(frozen=True)
class Gphoto2Settings:
    """Which camera, and its sensitivity.

    model: as the camera calls itself (``Canon EOS Rebel T6i``); port: where it is plugged in (``usb:001,004``), for
    two of the same model; both may be left out where one camera answers. iso: set before the first picture; without
    it the camera must stand on a fixed one.
    """

    model: str = ""
    port: str = ""
    iso: str = ""


class Gphoto2Camera:
    """A DSLR as a device that `Own` takes: ``(Hs, Ws, 3)`` uint16 at half the sensor's rows and columns."""

    def __init__(self, settings: Gphoto2Settings) -> None:
        """Opens it, sets RAW and a fixed exposure, and takes a first picture.

        UserError: the package is missing, no such camera or several, one that gives no RAW or whose shutter cannot be
        set, automatic exposure or sensitivity. DeviceError: it does not answer.
        """
        self.name = settings.model or "the DSLR"
        self._settings = settings
        self._camera: Any = None
        self._gp = _gphoto2()
        with closed_on_failure(self.close):
            self._open()
            first, _ = self._picture(nearest(self._shutter, 0.01))
        self.white = first.white
        self.exposures = min(self._exact.values()), max(self._exact.values())  # by its clock; ``bulb`` is not used

    def expose(self, seconds: float) -> tuple[Counts, float]:
        """A picture at the shutter speed nearest to ``seconds``, as a ratio, and the time [s] of that speed."""
        frame, real = self._picture(min(self._exact, key=lambda time: abs(math.log(self._exact[time] / seconds))))
        if frame.white != self.white:
            raise DeviceError(f"{self.name}: the white level went from {self.white:.0f} to {frame.white:.0f}")
        return np.minimum(frame.counts, np.uint16(self.white)), real  # beyond it all are saturated

    def close(self) -> None:
        """Give the camera back to the desktop."""
        if self._camera:
            self._camera.exit()

    def _open(self) -> None:
        gp, settings = self._gp, self._settings
        answering = _answering(gp)
        fitting = [
            (model, port)
            for model, port in answering
            if settings.model.lower() in ("", model.lower()) and settings.port in ("", port)
        ]
        listed = [f"{model} at {port}" for model, port in answering]
        model, port = only("camera", settings.model or "any", fitting, listed)
        camera = gp.Camera()
        abilities, ports = gp.CameraAbilitiesList(), gp.PortInfoList()
        abilities.load()
        ports.load()
        camera.set_abilities(abilities.get_abilities(abilities.lookup_model(model)))
        camera.set_port_info(ports.get_info(ports.lookup_path(port)))
        camera.init()
        self._camera = camera
        serial = self._value("serialnumber")
        self.name = f"{model} {serial}".strip()

        self._fix_exposure()
        if (config := next(filter(self._choices, FORMATS), None)) is not None:
            self._choose(config, lambda word: bool(FULL_RAW.search(word)) and not LESS_THAN_RAW.search(word))
        with contextlib.suppress(UserError, DeviceError):  # else its card fills up
            self._choose("capturetarget", lambda choice: bool(re.search(r"ram", choice, re.IGNORECASE)))

    def _fix_exposure(self) -> None:
        for mode in MODES:
            if not (value := self._value(mode) or "M").upper().startswith("M"):
                raise UserError(f"{self.name} stands on '{value}', which sets exposures by itself; turn its dial to M")
        if self._settings.iso:
            self._choose("iso", lambda choice: choice == self._settings.iso)
        elif "auto" in self._value("iso").lower():
            raise UserError(f"{self.name} sets its ISO by itself; give one, such as iso: '100'")
        self._shutter = speeds(self._choices("shutterspeed"))
        if not self._shutter:
            raise UserError(f"{self.name} does not let its shutter speed be set over USB; is its dial on M?")
        self._exact = exact(self._shutter)

    def _picture(self, shutter: float) -> tuple[RawFrame, float]:
        data = self._take(shutter)
        if is_jpeg(data):
            raise UserError(
                f"{self.name} gave a JPEG, whose values are not linear in light; set its image quality to RAW alone"
            )
        try:
            return read_raw(data, f"a picture of {self.name}"), self._exact[shutter]
        except UserError as error:
            raise DeviceError(str(error)) from error

    def _take(self, shutter: float) -> bytes:
        gp, camera = self._gp, self._camera
        wanted = self._shutter[shutter]
        if self._value("shutterspeed") != wanted:
            self._choose("shutterspeed", lambda choice: choice == wanted)
        if (kept := self._value("shutterspeed")) != wanted:
            raise DeviceError(f"{self.name}: the shutter speed stays at {kept}, not {wanted}")
        path = camera.capture(gp.GP_CAPTURE_IMAGE)
        # the file must outlive the look at its memory, which does not keep it
        file = camera.file_get(path.folder, path.name, gp.GP_FILE_TYPE_NORMAL)
        data = bytes(file.get_data_and_size())
        with contextlib.suppress(gp.GPhoto2Error):  # some forget it by themselves
            camera.file_delete(path.folder, path.name)
        return data

    def _widget(self, config: str) -> Any:
        try:
            return self._camera.get_single_config(config)
        except self._gp.GPhoto2Error:
            return None

    def _value(self, config: str) -> str:
        widget = self._widget(config)
        return "" if widget is None else str(widget.get_value()).strip()

    def _choices(self, config: str) -> list[str]:
        widget = self._widget(config)
        if widget is None or widget.get_type() not in (self._gp.GP_WIDGET_RADIO, self._gp.GP_WIDGET_MENU):
            return []
        return [] if widget.get_readonly() else [str(choice) for choice in widget.get_choices()]

    def _choose(self, config: str, fits: Callable[[str], bool]) -> None:
        choices = self._choices(config)
        choice = next((choice for choice in choices if fits(choice)), None)
        if choice is None:
            raise UserError(f"{self.name}: no fitting '{config}' among: {', '.join(choices) or 'nothing'}")
        widget = self._widget(config)
        widget.set_value(choice)
        self._camera.set_single_config(config, widget)


def list_cameras() -> list[str]:
    """``Canon EOS Rebel T6i at usb:001,004`` for every camera that answers; UserError without the package."""
    gp = _gphoto2()
    answering = asked("libgphoto2", "looking for cameras", LOOKING, lambda: _answering(gp))
    return [f"{model} at {port}" for model, port in answering]


def _answering(gp: Any) -> list[tuple[str, str]]:
    """Model and port of every camera that is there."""
    cameras = gp.Camera.autodetect()
    return [(cameras.get_name(index), cameras.get_value(index)) for index in range(cameras.count())]


def _gphoto2() -> Any:
    gphoto2 = import_package("gphoto2", "gphoto2", "the package gphoto2", "gphoto2")
    import_package("gphoto2", "rawpy", "rawpy to read RAW files", "raw")
    return gphoto2


def seconds(text: str) -> float | None:
    """The time [s] that a shutter speed stands for, as cameras write it: ``1/125``, ``0.5``, ``30``, ``0.0100s``,
    ``1"3``; None for ``bulb``, ``auto`` and whatever else is no time."""
    word = re.sub(r"\s*s(ec(onds?)?)?\.?$", "", text.strip(), flags=re.IGNORECASE).strip()
    if match := FRACTION.fullmatch(word):
        value = float(match[1]) / float(match[2]) if float(match[2]) else 0.0
    elif match := QUOTED.fullmatch(word):
        value = float(f"{match[1]}.{match[2] or 0}")
    elif match := PLAIN.fullmatch(word):
        value = float(match[1].replace(",", "."))
    else:
        return None
    return value if 0 < value < math.inf else None


def speeds(choices: Iterable[str]) -> dict[float, str]:
    """Time [s] to the camera's own word for it, shortest first, without what is no time."""
    words = {time: choice for choice in choices if (time := seconds(choice)) is not None}
    return dict(sorted(words.items()))


def nearest(times: Iterable[float], wanted: float) -> float:
    """The time with the smallest ratio to the wanted one."""
    return min(times, key=lambda time: abs(math.log(time / wanted)))


def exact(speeds: Iterable[float]) -> dict[float, float]:
    """What a camera's written times [s] really are: its shutter runs in exact halves or thirds of a stop.

    So 1/60 s is 1/64 s, 30 s are 32 s, and taking the written times would make a linear sensor look bent by 6 %. Which
    steps a camera has is seen from its whole list; a list that fits neither is taken at its word.
    """
    written = list(speeds)
    stops = [math.log2(time) for time in written]
    # rms distance from whole numbers
    spread = {n: math.sqrt(fmean((n * stop - round(n * stop)) ** 2 for stop in stops)) for n in (1, 2, 3)}
    parts = min(spread, key=lambda part: spread[part])
    if spread[parts] > LARGEST_SPREAD:
        return {time: time for time in written}
    return {time: 2.0 ** (round(stop * parts) / parts) for time, stop in zip(written, stops, strict=True)}


DRIVERS = (Driver("camera", "gphoto2", Gphoto2Settings, Gphoto2Camera, "gphoto2", "gphoto2", list_cameras),)
