"""Methods that are not this package's run in a process of their own, which holds no bench, no score and no record.

The harness gets what such a method declares, asks it to solve, and answers what it asks of the display.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar

import torch
from pydantic import TypeAdapter, ValidationError

from ...core import parameters, plugins
from ...core.device import CPU
from ...core.errors import CellError, UserError
from ...core.hashing import canonical
from ...core.schema import FieldError
from ..definition import Isolation, Limits
from . import process
from .inside import FUNCTIONS
from .messages import Unsendable

__all__ = ["Apart", "Unsendable", "build", "find", "imports", "opened", "params_of", "runs_inside", "solver", "words"]

BOOLEANS = ("camera", "privileged", "trains", "follows", "planes")


class Apart:
    """A method that runs elsewhere: what its class declares, and its functions as calls to its process.

    For each method there is a class of it, as ``find`` makes them. refused: what its file imports that is hidden from
    methods, so that it can only run inside.
    """

    file: ClassVar[str]
    folder: ClassVar[Path]
    code_version: ClassVar[str]
    refused: ClassVar[str]

    def __init__(self, params: Mapping[str, Any], limits: Limits | None = None) -> None:
        self.params = dict(params)
        self.limits = limits or Limits(seconds=process.IMPORT_LIMIT)
        self._opened: process.Call | None = None

    def _call(self, function: str, *args: Any) -> Any:
        if self._opened is not None:
            return process.call(self._opened, function, self.params, args)
        handle = next((argument for argument in args if isinstance(argument, process.Handle)), None)
        with opened(self, CPU if handle is None else handle.device):
            return self._call(function, *args)


@contextmanager
def opened(method: object, device: torch.device) -> Iterator[int | None]:
    """A process for the next call of a method, ready before the clock runs; its number, None for a method that runs
    inside."""
    if not isinstance(method, Apart) or method._opened is not None:
        yield None
        return
    with process.process_of(method.file, method.folder).opened(device, method.limits) as call:
        method._opened = call
        try:
            yield call.pid
        finally:
            method._opened = None


def find(name: str, folder: Path) -> type[Any]:
    """What a method declares: its class, or one that stands for it. UserError as ``plugins.find``."""
    installed = plugins.is_shipped("methods", name) or not (".py:" in name or name in plugins.names("methods"))
    return plugins.find("methods", name, folder) if installed else _apart(name, folder)


def _apart(name: str, folder: Path) -> type[Apart]:
    facts = process.process_of(name, folder).facts
    flags = facts["flags"]
    for flag in BOOLEANS:
        if not isinstance(flags.get(flag, False), bool):
            raise UserError(f"method '{name}': {flag} should be True or False")
    functions = {function: _calling(function) for function in FUNCTIONS if function in facts["functions"]}
    identity = {"file": name, "folder": folder, "code_version": facts["version"], "__doc__": facts["doc"]}
    identity["refused"] = str(facts["refused"])
    return type(facts["name"], (Apart,), {**flags, **functions, **identity})


def _calling(function: str) -> Any:
    def call(self: Apart, *args: Any) -> Any:
        return self._call(function, *args)

    return call


def build(name: str, params: Mapping[str, Any], folder: Path) -> Any:
    """A method with its parameters checked and complete, for what it declares. UserError as ``plugins.build``, for a
    parameter that would say what only the class may declare, and where the method's process ends."""
    cls = find(name, folder)
    for flag in BOOLEANS:
        if flag in params:
            message = f"method '{name}': '{flag}' is no parameter; only its class declares it, as a ClassVar"
            raise FieldError((flag,), message, at_key=True)
    if not issubclass(cls, Apart):
        return plugins.build("methods", name, dict(params), folder)
    try:
        complete = cls(params)._call("params")
    except CellError as error:  # no cell is computed yet
        raise UserError(f"method '{name}' does not give its parameters: {error}") from error
    canonical(complete)
    return cls(complete)


def words(name: str, folder: Path) -> parameters.Words:
    """What a method says of itself. UserError as ``find``, and where its process ends or tells something else."""
    cls = find(name, folder)
    if not issubclass(cls, Apart):
        return parameters.words(cls)
    try:
        return TypeAdapter(parameters.Words).validate_python(cls({})._call("words"))
    except (CellError, ValidationError) as error:
        raise UserError(f"method '{name}' does not tell what it is: {error}") from error


def params_of(method: Any) -> dict[str, Any]:
    """Every parameter of a method as plain JSON values, defaults included."""
    return dict(method.params) if isinstance(method, Apart) else plugins.params_of(method)


def solver(name: str, params: Mapping[str, Any], folder: Path, isolation: Isolation, limits: Limits) -> Any:
    """A method to be called, in a process of its own within limits, or not."""
    if runs_inside(name, folder, isolation):
        return plugins.build("methods", name, dict(params), folder)
    return _apart(name, folder)(params, limits)


def imports(names: Iterable[str], folder: Path) -> dict[str, float]:
    """Seconds that the import of methods that do not ship with the package took, outside the clock of their cells."""
    return {
        name: round(process.process_of(name, folder).seconds, 2)
        for name in dict.fromkeys(names)
        if not plugins.is_shipped("methods", name)
    }


def runs_inside(name: str, folder: Path, isolation: Isolation) -> bool:
    """Whether a method's functions run in the process of the harness; those that look into the bench always do."""
    if isolation == "files":
        return plugins.is_shipped("methods", name)
    return isolation == "none" or bool(getattr(find(name, folder), "privileged", False))
