"""Panels and cameras by the name of their driver, as a bench file gives it (``slm:`` and ``camera:``)."""

from __future__ import annotations

import importlib.metadata
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any, Generic, Literal, TypeVar

from ...core.errors import UserError, suggest
from ..devices import Camera, DeviceError, Slm
from . import gphoto2_camera, micromanager_camera, opencv_camera, slmsuite_devices
from .gphoto2_camera import Gphoto2Camera, Gphoto2Settings
from .micromanager_camera import MicromanagerCamera, MicromanagerSettings
from .monitor import MonitorSettings, MonitorSlm, list_monitors
from .opencv_camera import OpencvCamera, OpencvSettings
from .slmsuite_devices import SlmsuiteCamera, SlmsuiteSettings, SlmsuiteSlm
from .worker import line

Device = TypeVar("Device", covariant=True)


@dataclass(frozen=True)
class Driver(Generic[Device]):
    """How devices of one kind are opened.

    settings: dataclass of its parameters; opens: the device for an instance of it; package: the distribution that it
    needs; extra: of this project, that installs it ("" for none); answering: lists what answers, in words; unlisted:
    what to do where the package cannot look for devices by itself.
    """

    settings: type[Any]
    opens: Callable[[Any], Device]
    package: str
    extra: str
    answering: Callable[[], list[str]]
    unlisted: str = ""


SLM_DRIVERS: Mapping[str, Driver[Slm]] = {
    "monitor": Driver(MonitorSettings, MonitorSlm, "pyglet", "monitor", list_monitors),
    "slmsuite": Driver(
        SlmsuiteSettings,
        SlmsuiteSlm,
        "slmsuite",
        "slmsuite",
        lambda: slmsuite_devices.classes("slms") and [],
        "slmsuite does not look for panels: give the class of yours as device, such as holoeye.Holoeye",
    ),
}

CAMERA_DRIVERS: Mapping[str, Driver[Camera]] = {
    "gphoto2": Driver(Gphoto2Settings, Gphoto2Camera, "gphoto2", "gphoto2", gphoto2_camera.list_cameras),
    "micromanager": Driver(
        MicromanagerSettings,
        MicromanagerCamera,
        "pymmcore-plus",
        "micromanager",
        lambda: micromanager_camera.list_installations() and [],
        "Micro-Manager does not look for cameras: write a configuration with its hardware wizard and give it as config",
    ),
    "opencv": Driver(OpencvSettings, OpencvCamera, "opencv-python-headless", "", opencv_camera.list_cameras),
    "slmsuite": Driver(
        SlmsuiteSettings,
        SlmsuiteCamera,
        "slmsuite",
        "slmsuite",
        lambda: slmsuite_devices.classes("cameras") and [],
        "slmsuite does not look for cameras: give the class of yours as device, such as thorlabs.ThorCam",
    ),
}


@dataclass(frozen=True)
class Found:
    """What is known of one driver on this computer, for ``holoeval doctor``.

    version: of its package, None where it is not installed; devices: what answers; why: where none does, what to do
    about it in one line, else "".
    """

    kind: Literal["slm", "camera"]
    driver: str
    version: str | None
    devices: tuple[str, ...]
    why: str


def open_slm(driver: str, params: Mapping[str, Any]) -> Slm:
    """The panel that ``driver`` opens with ``params``.

    UserError, in one line: an unknown driver or parameter, a wrong value, a package that is missing, no such panel.
    DeviceError: it is there, but does not answer.
    """
    return _open("slm", SLM_DRIVERS, driver, params)


def open_camera(driver: str, params: Mapping[str, Any]) -> Camera:
    """The camera that ``driver`` opens with ``params``; errors as ``open_slm``."""
    return _open("camera", CAMERA_DRIVERS, driver, params)


def found() -> list[Found]:
    """Every driver, what it needs, and which devices answer to it. Never raises."""
    slms = [_found("slm", name, driver) for name, driver in SLM_DRIVERS.items()]
    return slms + [_found("camera", name, driver) for name, driver in CAMERA_DRIVERS.items()]


def checked_params(kind: Literal["slm", "camera"], driver: str, params: Mapping[str, Any]) -> Any:
    """The settings of a driver, without opening anything, so that a bench file is refused before any device moves."""
    return _settings(kind, SLM_DRIVERS if kind == "slm" else CAMERA_DRIVERS, driver, params)


def _open(
    kind: Literal["slm", "camera"], drivers: Mapping[str, Driver[Device]], name: str, params: Mapping[str, Any]
) -> Device:
    settings = _settings(kind, drivers, name, params)
    return drivers[name].opens(settings)


def _settings(kind: str, drivers: Mapping[str, Driver[Any]], name: str, params: Mapping[str, Any]) -> Any:
    from pydantic import TypeAdapter, ValidationError

    if name not in drivers:
        raise UserError(f"unknown {kind} driver '{name}'; {suggest(name, drivers)}")
    settings = drivers[name].settings
    known = [field.name for field in fields(settings)]
    for key in params:
        if key not in known:
            raise UserError(f"{kind} driver '{name}' has no parameter '{key}'; {suggest(str(key), known)}")
    try:
        return TypeAdapter(settings).validate_json(json.dumps(dict(params)), strict=True)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        if first["type"] == "missing":
            raise UserError(f"{kind} driver '{name}' needs the parameter '{where}'") from None
        message = first["msg"][:1].lower() + first["msg"][1:]
        value = repr(first["input"])[:60]
        raise UserError(f"{kind} driver '{name}': parameter '{where}': {message}, got {value}") from None
    except TypeError as error:  # a value that YAML has and JSON has not, such as a date
        raise UserError(f"{kind} driver '{name}': {error}") from None


def _found(kind: Literal["slm", "camera"], name: str, driver: Driver[Any]) -> Found:
    try:
        version = importlib.metadata.version(driver.package)
    except importlib.metadata.PackageNotFoundError:
        extra = f"pip install 'holobench_eval[{driver.extra}]'" if driver.extra else f"pip install {driver.package}"
        return Found(kind, name, None, (), extra)
    try:
        devices = tuple(driver.answering())
    except (UserError, DeviceError) as error:
        return Found(kind, name, version, (), str(error))
    except Exception as error:  # a library that is installed but broken
        return Found(kind, name, version, (), line(error))
    return Found(kind, name, version, devices, "" if devices else driver.unlisted or "none answers; is it on?")
