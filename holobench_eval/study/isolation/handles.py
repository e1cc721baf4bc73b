"""A display as a method's process has it: nominal optics, and requests to the process that holds the display."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import torch
from torch import Tensor

from ...core.device import CPU, moved
from ...core.errors import BudgetError, CellError
from ...display.api import Capture, DisplaySpec, Simulation, white_irradiance
from ...display.metered import MeteredDisplay
from ...display.training import TrainingBench, TrainingImage, Value
from .messages import Channel, refuse_unsendable

ERRORS: dict[str, type[CellError]] = {"BudgetError": BudgetError}  # others arrive as a CellError
Known = dict[str, Any]
"""What never changes about a handle, sent once."""


def known(handle: MeteredDisplay | TrainingBench) -> Known:
    """What the process of a method gets of a handle when it begins."""
    if isinstance(handle, TrainingBench):
        return {"handle": "training", "spec": handle.spec, "images": handle.images, "held_out": handle.held_out}
    return {
        "handle": "solving",
        "spec": handle.spec,
        "label": handle._label,
        "target": handle._target,
        "budget": handle.budget,
        "learned": handle._learned,
        "target_name": handle.target_name,
        "target_sha256": handle.target_sha256,
    }


REQUESTS = {
    MeteredDisplay: ("capture", "announce", "keep", "rectify", "captures", "kept", "over", "generator"),
    TrainingBench: ("photograph", "announce", "captures", "seconds", "load", "save", "log", "generator"),
}


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


class _Remote:
    """What both handles share. device: where the method computes."""

    def __init__(self, channel: Channel, known: Known, device: torch.device) -> None:
        self.spec: DisplaySpec = known["spec"]
        self.device = device
        self._channel = channel

    def _ask(self, name: str, *args: Any, **named: Any) -> Any:
        with self._channel.lock:
            self._channel.send({"ask": name, "args": args, "named": named})
            got = self._channel.receive()
        if "error" in got:
            raise ERRORS.get(got["error"], CellError)(got["message"])
        return moved(got["value"], self.device)

    @property
    def captures(self) -> int:
        """Captures taken so far."""
        return int(self._ask("captures"))

    def generator(self, *names: object) -> torch.Generator:
        """Random numbers that depend on the study's seed and ``names``; what else they depend on is not told."""
        return torch.Generator().manual_seed(self._ask("generator", *map(str, names)))


class SolvingHandle(_Remote):
    """``MeteredDisplay`` at a distance: the same names, arguments and errors."""

    def __init__(self, channel: Channel, known: Known, device: torch.device) -> None:
        super().__init__(channel, known, device)
        self.budget: int | None = known["budget"]
        self.target_name, self.target_sha256 = str(known["target_name"]), str(known["target_sha256"])
        self._label, self._target, self._learned = known["label"], known["target"], known["learned"]

    @property
    def kept(self) -> Tensor | None:
        """See ``MeteredDisplay``."""
        return self._ask("kept")

    @property
    def over(self) -> str:
        """See ``MeteredDisplay``."""
        return str(self._ask("over"))

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

    def capture(self, phase: Tensor) -> Capture:
        """See ``MeteredDisplay``."""
        return self._ask("capture", phase)

    def announce(self, phases: Sequence[Tensor]) -> None:
        """See ``MeteredDisplay``."""
        self._ask("announce", list(phases))

    def keep(self, phase: Tensor) -> None:
        """See ``MeteredDisplay``."""
        self._ask("keep", phase)

    def rectify(self, capture: Capture) -> Tensor:
        """See ``MeteredDisplay``."""
        return self._ask("rectify", capture)


class TrainingHandle(_Remote):
    """``TrainingBench`` at a distance: the same names, arguments and errors."""

    def __init__(self, channel: Channel, known: Known, device: torch.device) -> None:
        super().__init__(channel, known, device)
        self.images, self.held_out = (
            tuple(TrainingImage(image.item, image.target.to(device)) for image in known[name])
            for name in ("images", "held_out")
        )

    @property
    def seconds(self) -> float:
        """See ``TrainingBench``."""
        return float(self._ask("seconds"))

    def light(self, image: TrainingImage) -> Tensor:
        """See ``TrainingBench``."""
        return white_irradiance(image.target, self.spec)

    def photograph(self, phase: Tensor, image: TrainingImage, *names: object) -> Tensor:
        """See ``TrainingBench``."""
        return self._ask("photograph", phase, image, *map(str, names))

    def announce(self, photographs: Iterable[tuple[Tensor, TrainingImage, tuple[object, ...]]]) -> None:
        """See ``TrainingBench``."""
        self._ask("announce", [(phase, image, tuple(map(str, names))) for phase, image, names in photographs])

    def kept(self, name: str, make: Callable[[], Value]) -> Value:
        """See ``TrainingBench``."""
        if (before := self.load(name)) is not None:
            return before
        value = make()
        self.save(name, value)
        return value

    def load(self, name: str) -> Value | None:
        """See ``TrainingBench``."""
        return self._ask("load", name)

    def save(self, name: str, value: Value) -> None:
        """See ``TrainingBench``."""
        self._ask("save", name, moved(value, CPU))

    def log(self, **row: float | int | str) -> None:
        """See ``TrainingBench``."""
        self._ask("log", **row)
