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
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import MinLen

from ...core.errors import UserError, suggest
from ...imaging.convention import Levels
from ..devices import Counts, DeviceError
from .driver import Driver, Kind, import_package, load
from .worker import line

Hardware = Literal["slms", "cameras"]

# they have a driver here that can tell what slmsuite's cannot: which monitor, and what a camera does of itself
ELSEWHERE = {
    "screenmirrored.ScreenMirrored": "driver 'monitor', which finds a monitor by its name and reads back what it shows",
    "webcam.Webcam": "driver 'opencv', which switches off what a webcam does of itself",
    "mmcore.MMCore": "driver 'micromanager'",
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
    """Any panel with slmsuite's interface and 8 bits, open, as a device that `Own` takes. UserError for other bits."""

    def __init__(self, slm: Any) -> None:
        self._slm, self.name, self.shape, self.close = slm, f"slmsuite {slm.name}", slm.shape, slm.close
        if slm.bitdepth != 8:
            slm.close()
            raise UserError(f"{self.name} takes {slm.bitdepth} bits, not 8; set it to 8 bits in its arguments")

    def show(self, levels: Levels) -> None:
        """Show ``(H, W)`` uint8 levels as they are; returns when slmsuite says that they are written."""
        written = self._slm.set_phase(levels.copy(), phase_correct=False, settle=False)
        written = np.asarray(
            written.get() if hasattr(written, "get") else written
        )  # get: from a graphics card's memory
        if written.dtype != np.uint8 or not np.array_equal(written, levels):
            raise DeviceError(f"{self.name}: slmsuite altered the levels; this panel's class cannot be used")


class SlmsuiteCamera:
    """Any camera with slmsuite's interface, open, as a device that `Own` takes: of colours the channel that it keeps.

    UserError where it does not tell its exposures.
    """

    def __init__(self, camera: Any) -> None:
        self._camera, self.name, self.close = camera, f"slmsuite {camera.name}", camera.close
        # slmsuite would add frames up; the mean is taken by whoever asks for several
        camera.averaging = camera.hdr = None
        self.white = camera.bitresolution - 1
        if camera.exposure_bounds_s is None:
            camera.close()
            raise UserError(f"{self.name} does not tell its exposures; add arguments.exposure_bounds_s: [1e-4, 1.0]")
        shortest, longest = camera.exposure_bounds_s
        self.exposures = max(float(shortest), 1e-6), float(longest)

    def expose(self, seconds: float) -> tuple[Counts, float]:
        """A frame that was begun after the call, and the exposure [s] that the camera reports of it."""
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


def theirs(kind: Kind, device: Any) -> SlmsuiteSlm | SlmsuiteCamera:
    """An open device with slmsuite's interface. AttributeError for another one."""
    return SlmsuiteSlm(device) if kind == "slm" else SlmsuiteCamera(device)


def _driver(kind: Kind, hardware: Hardware, words: str, example: str) -> Driver:
    def opens(settings: SlmsuiteSettings) -> SlmsuiteSlm | SlmsuiteCamera:
        return theirs(kind, _find(hardware, settings.device)(**settings.arguments))

    why = f"slmsuite does not look for {words}: give the class of yours as device, such as {example}"
    return Driver(
        kind, "slmsuite", SlmsuiteSettings, opens, "slmsuite", "slmsuite", lambda: classes(hardware) and [], why
    )


DRIVERS = (
    _driver("slm", "slms", "panels", "holoeye.Holoeye"),
    _driver("camera", "cameras", "cameras", "thorlabs.ThorCam"),
)
