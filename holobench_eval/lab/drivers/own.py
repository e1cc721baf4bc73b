"""A panel or a camera of a lab's own: a class in a file (``driver: path/to/file.py:Class``), or an object of Python."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import make_dataclass
from typing import Any

import numpy as np

from ...core.errors import UserError
from ...core.plugins import fields_of
from ...imaging.convention import Levels
from ..devices import Counts, DeviceError
from .driver import Driver, Kind, load
from .worker import Worker, closed_on_failure

OPENING, SHOWING, READING = 120.0, 20.0, 20.0  # seconds; some SDKs upload a look-up table first
EXPOSURES = 30  # that a picture may take beyond these; some SDKs throw frames away

NEEDS: Mapping[Kind, Mapping[str, str]] = {
    "slm": {"show": "show(levels)", "shape": "(rows, columns) in pixels"},
    "camera": {
        "expose": "expose(seconds), which returns (counts, seconds)",
        "white": "the counts of a saturated sample, up to 65535",
        "exposures": "(shortest, longest) in seconds",
    },
}
FITS: Mapping[str, Callable[[Any], bool]] = {
    "shape": lambda sides: len(sides) == 2 and all(side >= 1 and side == int(side) for side in sides),
    "white": lambda white: 0 < float(white) <= np.iinfo(np.uint16).max,
    "exposures": lambda times: len(times) == 2 and 0 < times[0] < times[1] < np.inf,
}


class Own:
    """A device of a lab's own as a `Slm` or a `Camera`: on a thread of its own, and what it gives is looked at."""

    shape: tuple[int, int]
    white: float
    exposures: tuple[float, float]
    show_sequence: Callable[[Any], None]

    def __init__(self, kind: Kind, device: Any, worker: Worker) -> None:
        """device: open, and closed with this; worker: the thread it lives on. UserError: it lacks something."""
        name = str(getattr(device, "name", "") or f"{kind} {type(device).__name__}")
        for key, right in NEEDS[kind].items():
            try:
                good = FITS.get(key, callable)(getattr(device, key, None))
            except (TypeError, ValueError):
                good = False
            if not good:
                what = f"{key} is {getattr(device, key)!r}" if hasattr(device, key) else f"it has no '{key}'"
                raise UserError(f"{name}: {what}; expected {right}")
        self._device, self._worker = device, worker
        self._size: tuple[int, ...] = ()  # of the first frame
        self.name, self._worker.idle = name, getattr(device, "idle", None)
        self._worker.name = name
        if kind == "slm":
            self.shape = int(device.shape[0]), int(device.shape[1])
            if hasattr(device, "show_sequence"):
                self.show_sequence = lambda frames: self._show(device.show_sequence, *frames)
        else:
            self.white, self.exposures = float(device.white), (float(device.exposures[0]), float(device.exposures[1]))

    def show(self, levels: Levels) -> None:
        """See `Slm`; DeviceError for whatever the device raises."""
        self._show(lambda frames: self._device.show(*frames), levels)

    def expose(self, seconds: float) -> tuple[Counts, float]:
        """See `Camera`; DeviceError for what is no photograph, and for whatever the device raises."""
        limit = READING + EXPOSURES * seconds
        given = self._worker.call("taking a picture", limit, lambda: self._device.expose(seconds))
        try:
            counts, real = given
            frame, real = np.array(counts), float(real)  # a copy, since a device may fill its memory again
        except (TypeError, ValueError):
            types = [type(each).__name__ for each in given] if isinstance(given, tuple) else [type(given).__name__]
            what = f"expose returned {', '.join(types)}; expected (counts, seconds)"
            raise DeviceError(f"{self.name}: {what}") from None
        planes = frame.ndim == 2 or (frame.ndim == 3 and frame.shape[2] == 3)
        if frame.dtype not in (np.uint8, np.uint16) or not planes or not frame.size:
            right = "whole counts, uint8 or uint16 of (H, W) or (H, W, 3)"
            raise DeviceError(f"{self.name} gave {frame.dtype} of {frame.shape}; expected {right}")
        if frame.shape != (self._size or frame.shape):
            raise DeviceError(f"{self.name}: a frame of {frame.shape} follows one of {self._size}")
        self._size = frame.shape
        if frame.max() > self.white:
            what = f"{frame.max()} counts, but {self.white:.0f} are its white; set white, or shift the counts down"
            raise DeviceError(f"{self.name} gave {what}")
        return frame, real

    def close(self) -> None:
        """Give the device back."""
        self._worker.stop(READING, getattr(self._device, "close", lambda: None))

    def _show(self, function: Callable[[list[Levels]], Any], *frames: Levels) -> None:
        for frame in frames:
            if frame.dtype != np.uint8 or frame.shape != self.shape:  # nothing is converted
                given = f"{frame.dtype} of {frame.shape}"
                raise DeviceError(f"{self.name} takes uint8 levels of {self.shape}, not {given}")
        copies = [frame.copy() for frame in frames]  # a device may keep what it is given
        self._worker.call("showing a picture", SHOWING, lambda: function(copies))


def own_driver(kind: Kind, name: str) -> Driver:
    """The driver that a class of a file is, with the parameters that the class has. UserError: there is none."""
    owner, cls = f"{kind} driver '{name}'", load(name, f"{kind} driver")
    try:
        settings = make_dataclass(cls.__name__, fields_of(cls, owner), kw_only=True)
    except (TypeError, ValueError, NameError) as error:
        raise UserError(f"{owner}: its parameters cannot be taken from a bench file: {error}") from error

    return Driver(kind, name, settings, lambda params: cls(**vars(params)), "", "", list)


def opened(kind: Kind, name: str, make: Callable[[], Any]) -> Own:
    """A device that ``make`` gives, on a thread of its own. UserError: it lacks something. DeviceError: it fails."""
    worker = Worker(name)
    with closed_on_failure(lambda: worker.stop(0, lambda: None)):
        return worker.call("opening", OPENING, lambda: Own(kind, make(), worker))
