"""Plug-ins that cost nothing, for tests of the machinery alone: a file beside the config of a study."""

import hashlib
import time
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import torch

LOG = Path(__file__).with_name("solves.txt")


def is_held(target):
    """Whether a test holds a target: said in the file that methods write, since any other would be read by them."""
    lines = LOG.read_text()
    return lines.rfind(f"hold {target}\n") > lines.rfind(f"free {target}\n")


@dataclass(frozen=True)
class Gray:
    """A fake dataset of even grays."""

    count: int = 3

    def items(self):
        return [f"gray {i}" for i in range(self.count)]

    def digest(self, item):
        return hashlib.sha256(item.encode()).hexdigest()

    def load(self, item, shape, channels=3):
        return torch.full((channels, *shape), (1 + int(item.split()[1])) / 10)


@dataclass(frozen=True)
class Toy:
    """A fake method: a constant phase, and a line in a file for every solution; it waits while a test holds it."""

    value: float = 1.0
    pause: float = 0.0
    fail: str = ""
    camera: ClassVar[bool] = False
    privileged: ClassVar[bool] = False

    def solve(self, target, bench):
        with LOG.open("a") as log:
            log.write(f"{type(self).__name__} {self.value} {float(target.mean()):.1f}\n")
        time.sleep(self.pause)
        while is_held(f"{float(target.mean()):.1f}"):
            time.sleep(0.01)
        if self.fail and abs(float(target.mean()) - 0.2) < 1e-3:
            raise ValueError(self.fail)
        shape = (*target.shape[:2], *bench.spec.shape)
        return torch.full(shape, self.value) + 0.01 * torch.rand(shape, generator=bench.generator("toy"))


@dataclass(frozen=True)
class Nameless(Toy):
    def solve(self, target, bench):
        raise ValueError(chr(0xDCFF) + ".png")


class Target(torch.Tensor):
    """Would answer the display's own questions with the target."""


@dataclass(frozen=True)
class Disguised(Toy):
    def solve(self, target, bench):
        return super().solve(target, bench).as_subclass(Target)


@dataclass(frozen=True)
class Seeing(Toy):
    camera: ClassVar[bool] = True


@dataclass(frozen=True)
class Following(Toy):
    """Its own phase, or that of another method with the largest mean; the fake display likes it best."""

    privileged: ClassVar[bool] = True
    follows: ClassVar[bool] = True

    def solve(self, target, bench):
        phases = super().solve(target, bench), *(start[None] for start in bench.starts)
        return max(phases, key=lambda phase: phase.mean())


@dataclass(frozen=True)
class Needy(Toy):
    """Runs where a file says so."""

    def available(self):
        return None if LOG.with_name("here").exists() else "no lens; buy one"
