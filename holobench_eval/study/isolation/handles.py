"""A display as a method's process has it: nominal optics, and requests to the process that holds the display."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping, Sequence
from functools import wraps
from typing import Any

import torch
from torch import Tensor

from ...core.device import CPU, moved
from ...core.errors import BudgetError, CellError
from ...display.api import DisplaySpec, Simulation, white_irradiance
from ...display.metered import MeteredDisplay, Solver
from ...display.training import TrainingBench, TrainingImage, Value
from .messages import Channel, refuse_unsendable

ERRORS: dict[str, type[CellError]] = {"BudgetError": BudgetError}  # others arrive as a CellError
CONSTANTS: dict[type[Any], tuple[str, ...]] = {
    MeteredDisplay: ("spec", "budget", "target_name", "target_sha256", "_label", "_target", "_learned"),
    TrainingBench: ("spec", "images", "held_out"),
}
"""Constant fields of a handle, sent at the start."""
REQUESTS: dict[type[Any], tuple[str, ...]] = {
    MeteredDisplay: ("capture", "announce", "keep", "rectify", "captures", "kept", "over", "generator"),
    TrainingBench: ("photograph", "announce", "captures", "seconds", "load", "save", "log", "generator"),
}
"""Members of a handle that a method may ask for. One with the same arguments on both sides needs only its name here."""


def known(handle: MeteredDisplay | TrainingBench) -> dict[str, Any]:
    """What the process of a method gets of a handle when it begins."""
    constants = {name: getattr(handle, name) for name in CONSTANTS[type(handle)]}
    return {"handle": type(handle).__name__, "known": constants}


def answer(
    handle: MeteredDisplay | TrainingBench | None, name: str, args: Sequence[Any], named: Mapping[str, Any]
) -> Any:
    """What a handle says to a request. CellError for a request that no method may make."""
    if handle is None or name not in REQUESTS[type(handle)]:
        raise CellError(f"there is no '{name}' here")
    if name == "save":
        refuse_unsendable(args, "what a method saves")
    value = getattr(handle, name)
    if not callable(value):
        return value
    value = value(*args, **named)
    return value.initial_seed() if isinstance(value, torch.Generator) else value


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
    """What both handles share. of: the handle that one stands for; device: where the method computes."""

    spec: DisplaySpec

    def __init_subclass__(cls, of: type[Any]) -> None:
        for name in CONSTANTS[of]:
            setattr(cls, name, None)  # each object has its own; here so that ``dir`` of the class shows it
        for name in REQUESTS[of]:
            if not hasattr(cls, name):
                setattr(cls, name, _request(name, getattr(of, name)))

    def __init__(self, channel: Channel, known: Mapping[str, Any], device: torch.device) -> None:
        vars(self).update(known)
        self.device = device
        self._channel = channel

    def _ask(self, name: str, /, *args: Any, **named: Any) -> Any:
        with self._channel.lock:
            self._channel.send({"ask": name, "args": args, "named": named})
            got = self._channel.receive()
        if "error" in got:
            raise ERRORS.get(got["error"], CellError)(got["message"])
        return moved(got["value"], self.device)

    def generator(self, *names: object) -> torch.Generator:
        """Random numbers that depend on the study's seed and ``names``; what else they depend on is not told."""
        return torch.Generator().manual_seed(self._ask("generator", *map(str, names)))


class SolvingHandle(_Remote, of=MeteredDisplay):
    """``MeteredDisplay`` at a distance: the same names, arguments and errors."""

    _label: str
    _target: Tensor
    _learned: Mapping[str, Any] | None

    @property
    def learned(self) -> Mapping[str, Any]:
        """See ``MeteredDisplay``."""
        if self._learned is None:
            raise CellError(f"{self._label} was not trained; a method that learns declares trains = True")
        return moved(self._learned, self.device)

    @property
    def light(self) -> Tensor:
        """See ``MeteredDisplay``."""
        return white_irradiance(self._target, self.spec).to(self.device)

    @property
    def simulation(self) -> Simulation:
        """Not to be had: the bench is in another process."""
        raise CellError(f"{self._label}: the simulated bench is in another process; only isolation: none shows it")

    starts = simulation

    def solved(self, method: Solver, target: Tensor) -> Tensor:
        """See ``MeteredDisplay``; here nothing is kept."""
        return method.solve(target, self)

    def announce(self, phases: Sequence[Tensor]) -> None:
        """See ``MeteredDisplay``."""
        self._ask("announce", list(phases))


class TrainingHandle(_Remote, of=TrainingBench):
    """``TrainingBench`` at a distance: the same names, arguments and errors."""

    kept, light = TrainingBench.kept, TrainingBench.light

    def __init__(self, channel: Channel, known: Mapping[str, Any], device: torch.device) -> None:
        super().__init__(channel, known, device)
        self.images, self.held_out = (
            tuple(TrainingImage(image.item, image.target.to(device)) for image in known[name])
            for name in ("images", "held_out")
        )

    def solved(self, method: Solver, image: TrainingImage) -> Tensor:
        """See ``TrainingBench``; here nothing is kept."""
        return method.solve(image.target[None], self)[0]

    def photograph(self, phase: Tensor, image: TrainingImage, *names: object) -> Tensor:
        """See ``TrainingBench``."""
        return self._ask("photograph", phase, image, *map(str, names))

    def announce(self, photographs: Iterable[tuple[Tensor, TrainingImage, tuple[object, ...]]]) -> None:
        """See ``TrainingBench``."""
        self._ask("announce", [(phase, image, tuple(map(str, names))) for phase, image, names in photographs])

    def save(self, name: str, value: Value) -> None:
        """See ``TrainingBench``."""
        self._ask("save", name, moved(value, CPU))
