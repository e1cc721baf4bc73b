"""Cameras that Micro-Manager drives (driver ``micromanager``, extra ``[micromanager]``)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval, MinLen

from ...core.errors import UserError, suggest
from ..devices import Counts
from .driver import Driver, import_package
from .worker import closed_on_failure, line

Seconds = Annotated[float, Interval(gt=0, le=3600)]


@dataclass(frozen=True)
class MicromanagerSettings:
    """A configuration of Micro-Manager and what to set on its camera.

    config: the ``.cfg`` file that its hardware wizard wrote; camera: the camera's label in it, by default the one
    that the configuration makes the camera; adapters: folder of the device adapters, by default that of the
    Micro-Manager that is installed; properties: of the camera, set after the configuration, such as
    ``{PixelType: 16bit, Gain: "0"}``; exposures: shortest and longest [s], where the camera does not tell them.
    """

    config: Annotated[str, MinLen(1)]
    camera: str = ""
    adapters: str = ""
    properties: dict[str, str] = field(default_factory=dict)
    exposures: tuple[Seconds, Seconds] | None = None


class MicromanagerCamera:
    """A camera of Micro-Manager's as a device that `Own` takes; its properties switch off what it does of itself."""

    def __init__(self, settings: MicromanagerSettings) -> None:
        """UserError: the package is missing, no such file, label, property or value, no whole counts, no bounds."""
        if not Path(settings.config).is_file():
            raise UserError(f"driver 'micromanager': no such configuration: {settings.config}")
        self.name = "Micro-Manager"
        self._core: Any = None
        with closed_on_failure(self.close):
            self._open(settings)

    def close(self) -> None:
        """Give every device of the configuration back."""
        if self._core:
            self._core.unloadAllDevices()

    def _open(self, settings: MicromanagerSettings) -> None:
        self._core = core = _core()
        if settings.adapters:
            if not Path(settings.adapters).is_dir():
                raise UserError(f"driver 'micromanager': no such folder of adapters: {settings.adapters}")
            core.setDeviceAdapterSearchPaths([settings.adapters])
        elif not core.getDeviceAdapterSearchPaths():
            raise UserError(
                "driver 'micromanager': no Micro-Manager found; install it (mmcore install) or set adapters"
            )
        try:
            core.loadSystemConfiguration(settings.config)
        except Exception as error:
            raise UserError(f"driver 'micromanager': {settings.config}: {line(error)}") from error
        self._label = label = settings.camera or core.getCameraDevice()
        cameras = [name for name in core.getLoadedDevices() if "camera" in str(core.getDeviceType(name)).lower()]
        if label not in cameras:
            raise UserError(f"driver 'micromanager': no camera '{label}' in it; {suggest(label, cameras)}")
        core.setCameraDevice(label)
        self._set(settings.properties)
        self.name = f"Micro-Manager {core.getDeviceName(label)} {label}"

        if core.getNumberOfComponents() not in (1, 4) or self._bytes_of_a_sample() > 2:
            raise UserError(f"{self.name} gives no 8 or 16 bit counts; set another PixelType in properties")
        self.white = float(2 ** min(core.getImageBitDepth(), 8 * self._bytes_of_a_sample()) - 1)
        self.exposures = settings.exposures or self._reported_exposures()

    def _bytes_of_a_sample(self) -> int:
        return int(self._core.getBytesPerPixel() // self._core.getNumberOfComponents())

    def _set(self, properties: Mapping[str, str]) -> None:
        core, label = self._core, self._label
        for name, value in properties.items():
            if name not in (known := core.getDevicePropertyNames(label)):
                raise UserError(f"camera '{label}' has no property '{name}'; {suggest(name, known)}")
            try:
                core.setProperty(label, name, value)
                core.waitForDevice(label)
            except Exception as error:
                allowed = ", ".join(core.getAllowedPropertyValues(label, name))
                hint = f"; allowed: {allowed}" if allowed else ""
                raise UserError(f"camera '{label}': property '{name}' cannot be '{value}'{hint}") from error

    def _reported_exposures(self) -> tuple[float, float]:
        core, label = self._core, self._label
        if core.hasProperty(label, "Exposure") and core.hasPropertyLimits(label, "Exposure"):
            lower, upper = (
                read(label, "Exposure") for read in (core.getPropertyLowerLimit, core.getPropertyUpperLimit)
            )
            if upper > lower:
                return max(lower / 1000, 1e-6), upper / 1000
        raise UserError(f"{self.name} does not tell its exposures; add exposures: [0.0001, 1.0]")

    def expose(self, seconds: float) -> tuple[Counts, float]:
        """A snap, and the exposure [s] that the camera reports of it."""
        core = self._core
        core.setExposure(seconds * 1000)
        core.waitForDevice(self._label)
        real = core.getExposure() / 1000
        core.snapImage()
        frame = np.asarray(core.getImage())
        return frame[..., :3] if frame.ndim == 3 else frame, real


def list_installations() -> list[str]:
    """The folders of device adapters that are found without being told; UserError for none, or no package."""
    folders = [str(folder) for folder in _core().getDeviceAdapterSearchPaths()]
    if not folders:
        raise UserError("driver 'micromanager': no Micro-Manager found; run mmcore install, or set adapters")
    return folders


def _core() -> Any:
    package = import_package("micromanager", "pymmcore_plus", "pymmcore-plus", "micromanager")
    core = package.CMMCorePlus()
    core.enableStderrLog(False)
    return core


DRIVERS = (
    Driver(
        "camera",
        "micromanager",
        MicromanagerSettings,
        MicromanagerCamera,
        "pymmcore-plus",
        "micromanager",
        lambda: list_installations() and [],
        "Micro-Manager does not look for cameras: write a configuration with its hardware wizard and give it as config",
    ),
)
