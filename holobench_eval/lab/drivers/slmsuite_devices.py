"""Panels and cameras that slmsuite drives, HOLOEYE's SDK among them (driver ``slmsuite``, extra ``[slmsuite]``).

slmsuite is given uint8 levels only: its ``set_phase`` hands integers of a panel's own type to the panel as they are,
where radians would be negated, wrapped by its own convention and corrected by a stored wavefront. What a maker's SDK
does with the levels after that is not seen by anybody; look-up tables and wavefront files are set up there, once.
"""

from __future__ import annotations

import importlib
import logging
import pkgutil
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import MinLen

from ...core.errors import UserError, suggest
from ...imaging.convention import Levels
from ..devices import Counts, DeviceError
from .driver import Driver, Kind, check_counts, check_levels, import_package, load
from .worker import Worker, closed_on_failure, line

Hardware = Literal["slms", "cameras"]

OPENING = 60.0  # seconds; some SDKs upload a look-up table first
SHOWING = 20.0
READING = 20.0  # beyond the exposures

# they have a driver here that can tell what slmsuite's cannot: which monitor, and what a camera does of itself
ELSEWHERE = {
    "screenmirrored.ScreenMirrored": "driver 'monitor', which finds a monitor by its name and reads back what it shows",
    "webcam.Webcam": "driver 'opencv', which switches off what a webcam does of itself",
    "mmcore.MMCore": "driver 'micromanager'",
}


INTERFACES: Mapping[Hardware, tuple[str, ...]] = {
    "slms": ("name", "shape", "bitdepth", "set_phase", "close"),
    "cameras": ("name", "bitresolution", "exposure_bounds_s", "set_exposure", "flush", "get_image", "close"),
}


@dataclass(frozen=True)
class SlmsuiteSettings:
    """Which class of slmsuite, and what it is built with.

    device: module and class, such as ``holoeye.Holoeye`` or ``thorlabs.ThorCam``, or another one with slmsuite's
    interface, ``path/to/file.py:Class`` or ``module:Class``; arguments: the class's own, such as
    ``{preselect: "index:0", wav_um: 0.52}`` (slmsuite's documentation lists them).
    """

    device: Annotated[str, MinLen(3)]
    arguments: dict[str, Any] = field(default_factory=dict)


class SlmsuiteSlm:
    """Any panel of slmsuite's with 8 bits, as an `Slm`."""

    def __init__(self, make: SlmsuiteSettings | Any) -> None:
        """make: settings, or an slmsuite SLM that is open already (it is closed with this).

        UserError: no such class, wrong arguments, its maker's software is missing, not 8 bits.
        """
        self._worker, self._slm = _opened("slms", make)
        self.name = f"slmsuite {self._slm.name}"
        self.shape: tuple[int, int] = tuple(int(side) for side in self._slm.shape)  # type: ignore[assignment]
        if self._slm.bitdepth != 8:
            self.close()
            raise UserError(f"{self.name} takes {self._slm.bitdepth} bits, not 8; set it to 8 bits in its arguments")

    def show(self, levels: Levels) -> None:
        """Show ``(H, W)`` uint8 levels as they are; returns when slmsuite says that they are written."""
        check_levels(self.name, self.shape, levels)
        # a driver may keep the array it is given
        written = self._worker.call("showing a picture", SHOWING, lambda: self._write(levels.copy()))
        if written.dtype != np.uint8 or not np.array_equal(written, levels):
            raise DeviceError(f"{self.name}: slmsuite altered the levels; this panel's class cannot be used")

    def close(self) -> None:
        """Give the panel back."""
        self._worker.stop(SHOWING, self._slm.close)

    def _write(self, levels: Levels) -> Any:
        written = self._slm.set_phase(levels, phase_correct=False, settle=False)
        return np.asarray(written.get() if hasattr(written, "get") else written)  # get: from a graphics card's memory


class SlmsuiteCamera:
    """Any camera of slmsuite's, as a `Camera`: of a colour camera the one channel that slmsuite keeps."""

    def __init__(self, make: SlmsuiteSettings | Any) -> None:
        """make: settings, or an slmsuite camera that is open already (it is closed with this).

        UserError: no such class, wrong arguments, its maker's software is missing, unknown exposure bounds.
        """
        self._worker, self._camera = _opened("cameras", make)
        self.name = f"slmsuite {self._camera.name}"
        # slmsuite would add frames up; the mean is taken by whoever asks for several
        self._camera.averaging = self._camera.hdr = None
        self.white = float(self._camera.bitresolution - 1)
        if self._camera.exposure_bounds_s is None:
            self.close()
            raise UserError(f"{self.name} does not tell its exposures; add arguments.exposure_bounds_s: [1e-4, 1.0]")
        shortest, longest = (float(bound) for bound in self._camera.exposure_bounds_s)
        self.exposures = max(shortest, 1e-6), longest

    def expose(self, seconds: float) -> tuple[Counts, float]:
        """A frame that was begun after the call, and the exposure [s] that the camera reports of it."""
        limit = READING + 6 * seconds * getattr(
            self._camera, "capture_attempts", 5
        )  # some frames are thrown away first
        frame, real = self._worker.call("taking a picture", limit, lambda: self._take(seconds))
        check_counts(self.name, frame, self.white, "; set its bit depth")
        return frame, real

    def close(self) -> None:
        """Give the camera back."""
        self._worker.stop(READING, self._camera.close)

    def _take(self, seconds: float) -> tuple[Counts, float]:
        real = float(self._camera.set_exposure(seconds))
        self._camera.flush()
        return np.asarray(self._camera.get_image(averaging=False, hdr=False)), real


def classes(kind: Hardware) -> list[str]:
    """The modules of slmsuite that drive panels or cameras, sorted. UserError where it is not installed."""
    package = import_package("slmsuite", f"slmsuite.hardware.{kind}", "slmsuite", "slmsuite")
    # as it comes, it writes to the standard output, where results go
    importlib.import_module("slmsuite").configure_logging(logging.WARNING, sys.stderr)
    names = {module.name for module in pkgutil.iter_modules(package.__path__)}
    return sorted(name for name in names if not name.startswith("_") and name not in ("camera", "slm", "template"))


def _opened(kind: Hardware, make: SlmsuiteSettings | Any) -> tuple[Worker, Any]:
    """The device and the thread that it lives on. UserError for one without slmsuite's interface."""
    name = make.device if isinstance(make, SlmsuiteSettings) else type(make).__name__
    maker = _find(kind, make.device) if isinstance(make, SlmsuiteSettings) else None
    worker = Worker(f"slmsuite {name}")
    with closed_on_failure(lambda: worker.stop(0, lambda: None)):
        device = worker.call("opening", OPENING, lambda: _build(maker, name, make.arguments)) if maker else make
        if lacking := [each for each in INTERFACES[kind] if not hasattr(device, each)]:
            raise UserError(f"device '{name}' has no '{lacking[0]}', which a {kind[:-1]} of slmsuite's has")
        return worker, device


def _find(kind: Hardware, device: str) -> Any:
    if ":" in device:
        return load(device, "device")
    module, _, name = device.partition(".")
    if device in ELSEWHERE:
        raise UserError(f"device '{device}': take {ELSEWHERE[device]}")
    if module not in (known := classes(kind)):
        raise UserError(f"slmsuite has no {kind[:-1]} module '{module}'; {suggest(module, known)}, then .Class")
    try:
        loaded = importlib.import_module(f"slmsuite.hardware.{kind}.{module}")
    except ImportError as error:
        raise UserError(f"device '{device}' needs its maker's software: {line(error)}") from error
    base = importlib.import_module(f"slmsuite.hardware.{kind}.{kind[:-1]}")
    parent = base.SLM if kind == "slms" else base.Camera
    device_classes = {
        key: item for key, item in vars(loaded).items() if isinstance(item, type) and issubclass(item, parent)
    }
    device_classes.pop(parent.__name__, None)
    if name not in device_classes:
        raise UserError(f"slmsuite.hardware.{kind}.{module} has no class '{name}'; {suggest(name, device_classes)}")
    return device_classes[name]


def _build(maker: Any, device: str, arguments: Mapping[str, Any]) -> Any:
    try:
        return maker(**arguments)
    except ImportError as error:
        raise UserError(f"device '{device}' needs its maker's software: {line(error)}") from error
    except (TypeError, ValueError) as error:
        raise UserError(f"device '{device}' cannot be built with these arguments: {line(error)}") from error


def _driver(kind: Kind, hardware: Hardware, cls: type[Any], words: str, example: str) -> Driver:
    why = f"slmsuite does not look for {words}: give the class of yours as device, such as {example}"
    return Driver(
        kind, "slmsuite", SlmsuiteSettings, cls, "slmsuite", "slmsuite", lambda: classes(hardware) and [], why
    )


DRIVERS = (
    _driver("slm", "slms", SlmsuiteSlm, "panels", "holoeye.Holoeye"),
    _driver("camera", "cameras", SlmsuiteCamera, "cameras", "thorlabs.ThorCam"),
)
