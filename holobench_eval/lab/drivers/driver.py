"""What all drivers share: their entry in the catalogue, and the package they need."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any, Literal, TypeVar

from ...core.errors import UserError, suggest
from ...core.hashing import State, file_state
from ...core.installed import installing
from ...core.plugins import is_file
from ...core.sources import import_file
from .worker import line

T = TypeVar("T")
Kind = Literal["slm", "camera"]


@dataclass(frozen=True)
class Driver:
    """How devices of one kind are opened; every module that `catalogue` names lists its own as ``DRIVERS``.

    name: as a bench file gives it; settings: dataclass of its parameters; opens: the device for an instance of it,
    called on a thread of the device's own; package: the distribution that it needs; extra: of this project, that
    installs it ("" for none); answering: lists what answers, in words; unlisted: what to do where the package cannot
    look for devices by itself.
    """

    kind: Kind
    name: str
    settings: type[Any]
    opens: Callable[[Any], Any]
    package: str
    extra: str
    answering: Callable[[], list[str]]
    unlisted: str = ""


def load(name: str, what: str) -> Any:
    """A class or a function, ``path/to/file.py:Name`` or ``module:Name``. UserError: there is none.

    A file is imported once for what it holds, so that a panel and a camera in it know of each other.
    """
    source, _, attribute = name.rpartition(":")
    if not source:
        raise UserError(f"{what} '{name}' should be path/to/file.py:Name or module:Name")
    try:
        is_python = source.endswith(".py")
        module = _imported(source, file_state(source)) if is_python else importlib.import_module(source)
    except (Exception, SystemExit) as error:  # whatever a user's module does when it is imported
        raise UserError(f"{what} '{name}' cannot be imported: {line(error)}") from error
    found = getattr(module, attribute, None)
    if not callable(found):
        own = [key for key, value in vars(module).items() if getattr(value, "__module__", "") == module.__name__]
        own = [key for key in own if callable(getattr(module, key))]
        fault = "no class or function" if hasattr(module, attribute) else "not there"
        raise UserError(f"{what} '{name}': '{attribute}' of {source} is {fault}; {suggest(attribute, own)}")
    return found


def located(name: str, folder: Path) -> str:
    """A name for `load`, where relative paths start in a folder."""
    return str((folder / name).absolute()) if is_file(name) else name


@lru_cache(maxsize=16)
def _imported(file: str, _state: State | None) -> ModuleType:
    return import_file(Path(file))


def import_package(driver: str, module: str, package: str, extra: str) -> Any:
    """The module of an optional package; UserError with the command that installs it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        hint = installing(extra=extra)
        raise UserError(f"driver '{driver}' needs {package}: {hint} ({line(error)})") from error


def only(what: str, asked: str, fitting: Sequence[T], listed: Sequence[str]) -> T:
    """The one device that fits; UserError that lists all there are for none or several."""
    if len(fitting) == 1:
        return fitting[0]
    number = f"{len(fitting)} {what}s" if fitting else f"no {what}"
    raise UserError(f"{number} '{asked}'; found: {', '.join(listed) or 'none; is it on, and not in use?'}")
