"""A display as a method's process has it: nominal optics, and requests to the process that holds the display."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping
from functools import wraps
from typing import Any

import torch
from torch import Tensor

from ...core.device import moved
from ...core.errors import BudgetError, CellError, StopError
from ...display.metered import MeteredDisplay
from ...display.training import TrainingBench, TrainingImage
from .messages import Channel

CONSTANTS: dict[type[Any], tuple[str, ...]] = {
    MeteredDisplay: ("spec", "budget", "target_name", "target_sha256", "_label", "_target", "_learned"),
    TrainingBench: ("spec", "images", "held_out"),
}
"""Constant fields of a handle, sent at the start."""
REQUESTS: dict[type[Any], tuple[str, ...]] = {
    MeteredDisplay: ("capture", "announce", "keep", "rectify", "captures", "kept", "over", "generator"),
    TrainingBench: ("photograph", "announce", "captures", "number", "seconds", "load", "save", "log", "generator"),
}
"""Members of a handle that a method may ask for. One with the same arguments on both sides needs only its name here."""


def known(handle: MeteredDisplay | TrainingBench) -> dict[str, Any]:
    """What the process of a method gets of a handle when it begins."""
    constants = {name: getattr(handle, name) for name in CONSTANTS[type(handle)]}
    return {"handle": type(handle).__name__, "known": constants}


def answer(handle: MeteredDisplay | TrainingBench | None, request: Mapping[str, Any]) -> dict[str, Any]:
    """What a handle says to a request: a value, or an error for the method to see, such as where none may ask that."""
    name = str(request["ask"])
    try:
        if handle is None or name not in REQUESTS[type(handle)]:
            raise CellError(f"there is no '{name}' here")
        args, value = moved(request["args"], handle.device), getattr(handle, name)
        if callable(value):
            value = value(*args, **request["named"])
        return {"value": value.initial_seed() if isinstance(value, torch.Generator) else value}
    except StopError:
        raise
    except Exception as error:
        return {"error": type(error).__name__, "message": str(error)}


def _request(name: str, member: Any) -> Any:
    """A property or function that asks for the member of that name in the process that holds the display."""
    if isinstance(member, property):
        return property(lambda self: self._ask(name), doc=member.__doc__)
    signature = inspect.signature(member)

    @wraps(member)
    def ask(self: _Remote, *args: Any, **named: Any) -> Any:
        given = signature.bind(self, *args, **named)
        return self._ask(name, *given.args[1:], **given.kwargs)  # only arguments by position are moved

    return ask


class _Remote:
    """What both handles have in the place of a display: constants, and requests to the process that holds it."""

    device: Any
    _known: Any = None
    _privileged = False

    def __init_subclass__(cls, of: type[Any]) -> None:
        for name in CONSTANTS[of]:
            setattr(cls, name, None)  # in the place of a property; each object has its own
        for name in REQUESTS[of]:
            if not hasattr(_Remote, name) and name not in vars(cls):
                setattr(cls, name, _request(name, getattr(of, name)))

    def __init__(self, channel: Channel, constants: Mapping[str, Any]) -> None:
        vars(self).update(constants)
        self._channel = channel

    def _ask(self, name: str, /, *args: Any, **named: Any) -> Any:
        with self._channel.lock:
            self._channel.send({"ask": name, "args": args, "named": named})
            got = self._channel.receive()
        if "error" in got:
            raise (BudgetError if got["error"] == "BudgetError" else CellError)(got["message"])
        return moved(got["value"], self.device)

    def generator(self, *names: object) -> torch.Generator:
        """Random numbers that depend on the study's seed and ``names``; what else they depend on is not told."""
        return torch.Generator().manual_seed(self._ask("generator", *map(str, names)))


class SolvingHandle(_Remote, MeteredDisplay, of=MeteredDisplay):
    """``MeteredDisplay`` at a distance: the same names, arguments and errors."""


class TrainingHandle(_Remote, TrainingBench, of=TrainingBench):
    """``TrainingBench`` at a distance: the same names, arguments and errors."""

    def photograph(self, phase: Tensor, image: TrainingImage, *names: object) -> Tensor:
        """See ``TrainingBench``."""
        return self._ask("photograph", phase, image, *map(str, names))

    def announce(self, photographs: Iterable[tuple[Tensor, TrainingImage, tuple[object, ...]]]) -> None:
        """See ``TrainingBench``."""
        self._ask("announce", [(phase, image, tuple(map(str, names))) for phase, image, names in photographs])
