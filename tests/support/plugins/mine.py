"""A method that photographs, and one that declares nonsense."""

import time
from dataclasses import dataclass
from typing import ClassVar

import torch

SLOW = time.sleep(0.05)


@dataclass(frozen=True)
class Mine:
    """Flat phases.

    And more.
    """

    level: float = 1.0
    camera: ClassVar[bool] = True
    tuned: ClassVar[str] = "on nothing"

    def available(self):
        return "no level" if self.level == 0 else None

    def solve(self, target, bench):
        shape = (*target.shape[:2], *bench.spec.shape)
        phase = torch.rand(shape, generator=bench.generator("start", 1)) * self.level
        for _ in range(2):
            phase = phase + bench.rectify(bench.capture(phase[0])).mean()
        bench.keep(phase)
        return phase


@dataclass(frozen=True)
class Odd(Mine):
    camera: ClassVar[str] = "yes"
