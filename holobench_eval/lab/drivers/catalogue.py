"""Panels and cameras by the name of their driver, as a bench file gives it (``slm:`` and ``camera:``)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any, get_args

from ...core.errors import UserError, suggest
from ...core.installed import installed, installing
from ...core.plugins import made
from ..devices import DeviceError
from .driver import Driver, Kind
from .own import Own, opened, own_driver
from .slmsuite_devices import theirs
from .worker import line

# a new driver is a module with ``DRIVERS``, and its name here; in the order of listings
MODULES = ("monitor", "gphoto2_camera", "micromanager_camera", "opencv_camera", "slmsuite_devices")


def drivers_in(modules: Iterable[str], kind: Kind) -> dict[str, Driver]:
    """The drivers of a kind that modules of this package list, by their names."""
    listed = (driver for module in modules for driver in import_module(f"{__package__}.{module}").DRIVERS)
    return {driver.name: driver for driver in listed if driver.kind == kind}


DRIVERS: Mapping[Kind, dict[str, Driver]] = {kind: drivers_in(MODULES, kind) for kind in get_args(Kind)}


@dataclass(frozen=True)
class Survey:
    """What is known of one driver on this computer, for ``holoeval doctor``.

    version: of its package, None where it is not installed; devices: what answers; why: where none does, what to do
    about it in one line, else "".
    """

    kind: Kind
    driver: str
    version: str | None
    devices: tuple[str, ...]
    why: str


def open_device(kind: Kind, driver: str, params: Mapping[str, Any]) -> Own:
    """The `Slm` or the `Camera` that ``driver`` opens with ``params``.

    UserError, in one line: an unknown driver or parameter, a wrong value, a package that is missing, no such device.
    DeviceError: it is there, but does not answer.
    """
    settings = checked_params(kind, driver, params)
    return opened(kind, f"{kind} driver '{driver}'", lambda: _driver(kind, driver).opens(settings))


def checked_params(kind: Kind, driver: str, params: Mapping[str, Any]) -> Any:
    """The settings of a driver, without opening anything, so that a bench file is refused before any device moves."""
    return made(_driver(kind, driver).settings, f"{kind} driver '{driver}'", dict(params))


def adopted(kind: Kind, device: Any) -> Own:
    """An open device of a user's, or of slmsuite's. UserError: it lacks something, or fails."""
    if isinstance(device, type):
        raise UserError(f"{kind} is the class {device.__name__}; expected an open device of it")
    call, interface = ("show", "set_phase") if kind == "slm" else ("expose", "get_image")
    is_theirs = hasattr(device, interface) and not hasattr(device, call)
    try:
        return opened(kind, kind, lambda: theirs(kind, device) if is_theirs else device)
    except DeviceError as error:
        raise UserError(str(error)) from error


def _driver(kind: Kind, name: str) -> Driver:
    if name in DRIVERS[kind]:
        return DRIVERS[kind][name]
    if ":" in name:
        return own_driver(kind, name)
    raise UserError(f"unknown {kind} driver '{name}'; {suggest(name, DRIVERS[kind])}, or path/to/file.py:Class")


def survey() -> list[Survey]:
    """Every driver, what it needs, and which devices answer to it. Never raises."""
    return [_survey(driver) for drivers in DRIVERS.values() for driver in drivers.values()]


def _survey(driver: Driver) -> Survey:
    version = installed(driver.package)
    if version is None:
        remedy = installing(extra=driver.extra) if driver.extra else installing(driver.package)
        return Survey(driver.kind, driver.name, None, (), remedy)
    devices: tuple[str, ...] = ()
    try:
        devices = tuple(driver.answering())
        why = "" if devices else driver.unlisted or "none answers; is it on?"
    except Exception as error:  # of ours, or of a library that is installed but broken
        why = str(error) if isinstance(error, UserError | DeviceError) else line(error)
    return Survey(driver.kind, driver.name, version, devices, why)
