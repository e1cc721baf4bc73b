"""What a method may see of a display while it is trained: a metered camera, training images, a memory of its own."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import torch
from torch import Tensor

from ..core.device import CPU, moved
from ..core.errors import CellError
from ..core.seeds import generator
from .account import Account, Journal
from .api import Camera, Display, DisplaySpec, white_irradiance
from .metered import Known, OpenLoop, Solver
from .phases import check_phase

Clock = Literal["kept", "opened", "none"]
Value = dict[str, Any]
"""Tensors, numbers, text, and lists and mappings of them: what can be kept in a file without code."""


@dataclass(frozen=True)
class TrainingImage:
    """An image to train with: its name and its linear light ``(C, h, w)`` in [0, 1]."""

    item: str
    target: Tensor

    def __repr__(self) -> str:
        return f"<training image '{self.item}': light {tuple(self.target.shape)}>"

    def to(self, device: torch.device) -> TrainingImage:
        """The same on a device."""
        return TrainingImage(self.item, self.target.to(device))


class Memory(Protocol):
    """Keeps values by name, whole or not at all, so that training can be killed at any moment."""

    def load(self, name: str) -> Value | None:
        """The value of a name; None if there is none."""

    def save(self, name: str, value: Value) -> None:
        """Keep a value, in the place of an older one of that name."""

    def log(self, row: Mapping[str, float | int | str]) -> None:
        """Append to the record of the training that people watch; a row again (after a resume) replaces the first."""


class TrainingBench:
    """A display for training: nominal optics, the images, a metered camera, and a memory that survives a kill.

    images: to train with; held_out: captured only to watch how well the captures of unseen images are predicted.
    budget: captures that may be taken, None for no limit; what is kept has its captures counted once. seed: the
    study's. known: of images by name, see ``MeteredDisplay``. journal: where captures are counted beside those of
    attempts that were cut short, see ``Journal``. clock: see ``number``.
    """

    def __init__(
        self,
        display: Display,
        label: str,
        images: Sequence[TrainingImage],
        held_out: Sequence[TrainingImage],
        memory: Memory,
        budget: int | None,
        seed: int,
        known: Mapping[str, Known] | None = None,
        journal: Journal | None = None,
        clock: Clock = "kept",
    ) -> None:
        self.images = tuple(images)
        self.held_out = tuple(held_out)
        self._display = display
        self._label = label
        self._memory = memory
        self._account = Account(label, budget, " for training", journal)
        self._seed = seed
        self._known = known
        self._clock, self._taken = clock, 0
        self._spent = 0.0
        self._started = time.perf_counter()

    @property
    def spec(self) -> DisplaySpec:
        """Nominal optics, public."""
        return self._display.spec

    @property
    def device(self) -> torch.device:
        """Where the images are, and with them all that is computed."""
        return next((image.target.device for image in (*self.images, *self.held_out)), CPU)

    @property
    def captures(self) -> int:
        """Captures taken so far, those before an interruption included, but for what was not kept then."""
        return self._account.captures

    @property
    def number(self) -> int:
        """Of the last capture, among all (``kept``), or among those since the bench was opened, whose camera is then
        registered anew (``opened``); 0 where people photograph in an order of their own (``none``)."""
        return {"kept": self.captures, "opened": self._taken, "none": 0}[self._clock]

    @property
    def seconds(self) -> float:
        """Time spent so far [s], that before an interruption included up to the last value kept."""
        return self._spent + time.perf_counter() - self._started

    def light(self, image: TrainingImage) -> Tensor:
        """Light at a white pixel, ``(C,)``, if all of the panel's went into the target; incident light is 1."""
        return white_irradiance(image.target, self.spec)

    def solved(self, method: Solver, image: TrainingImage) -> Tensor:
        """The phase ``(C, H, W)`` [rad] of an image by another method, see ``OpenLoop``."""
        known = (self._known or {}).get(image.item)
        return OpenLoop(self.spec, self.generator, image.target, known).solved(method, image.target[None])[0]

    def generator(self, *names: object) -> torch.Generator:
        """Random numbers that depend on the study's seed and ``names``."""
        return generator("training", self._seed, *names)

    def photograph(self, phase: Tensor, image: TrainingImage, *names: object) -> Tensor:
        """Show ``phase`` ``(C, H, W)`` [rad] and photograph it; counted.

        Returns the capture in the image's frame, ``(C, h, w)`` linear light; 1 is a white pixel at full efficiency.
        The noise depends on the study's seed, the image and ``names``. BudgetError when no capture is left, CellError
        for an image that is neither one of the bench's nor an even gray. What a phase would show is not looked at.
        """
        given = [known.target for known in (*self.images, *self.held_out) if known.item == image.item]
        own = any(known is image.target or torch.equal(known, image.target) for known in given)
        is_even = bool((image.target == image.target[:, :1, :1]).all())
        if not own and not is_even:
            raise CellError(f"{self._label} photographed '{image.item}', which is no image it may be trained with")
        check_phase(phase, self.spec, self._label)
        camera = self._camera(image, *names)
        self._account.take()
        self._taken += 1
        return self._display.rectified(camera.capture(phase.detach()), image.target)

    def announce(self, photographs: Iterable[tuple[Tensor, TrainingImage, tuple[object, ...]]]) -> None:
        """Tell the display the arguments of the next calls of ``photograph``, whatever those captures show.

        A bench whose photographs are taken elsewhere then asks for all of them at once; others need no notice.
        """
        for phase, image, names in itertools.islice(photographs, self._account.left()):
            self._camera(image, *names).announce([phase.detach()])

    def _camera(self, image: TrainingImage, *names: object) -> Camera:
        return self._display.session((self._seed, "training", image.item, *names), image.target)

    def kept(self, name: str, make: Callable[[], Value]) -> Value:
        """The value kept under ``name``; made and kept if there is none. What it took is counted once."""
        if (known := self.load(name)) is not None:
            return known
        value = make()
        self.save(name, value)
        return value

    def load(self, name: str) -> Value | None:
        """The value kept under ``name``, None if there is none."""
        known = self._memory.load(name)
        if known is None:
            return None
        self._account.resume(int(known["captures"]), int(known["total"]))
        if known["seconds"] > self.seconds:
            self._spent += known["seconds"] - self.seconds
        return moved(dict(known["value"]), self.device)

    def save(self, name: str, value: Value) -> None:
        """Keep a value under ``name``, in the place of an older one; what is kept does not depend on the device."""
        counted = {"captures": self.captures, "total": self._account.total, "seconds": self.seconds}
        self._memory.save(name, {"value": moved(value, CPU), **counted})

    def log(self, **row: float | int | str) -> None:
        """A row for those who watch: numbers by name, such as round, step, losses and fidelity.

        It gets all captures up to now, those that an interruption cost included.
        """
        self._memory.log({**row, "captures": self._account.total, "seconds": round(self.seconds, 1)})
