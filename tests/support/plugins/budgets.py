"""Methods that keep to their budget of captures, or do not."""

from dataclasses import dataclass
from typing import ClassVar

import torch

from holobench_eval.core.errors import BudgetError


@dataclass(frozen=True)
class Method:
    keeps: bool = True
    camera: ClassVar[bool] = True

    def phase(self, target, bench):
        return torch.full((*target.shape[:2], *bench.spec.shape), 2.0)


class Greedy(Method):
    """Captures for ever; hands in its phase first, and other ones never."""

    def solve(self, target, bench):
        phase = self.phase(target, bench)[0]
        if self.keeps:
            bench.keep(phase)
        while True:
            bench.capture(phase)
            phase.fill_(9.0)  # what was handed in is a copy


class Modest(Method):
    """Takes as many captures as it may, and no more."""

    def solve(self, target, bench):
        for _ in range(bench.budget or 1):
            bench.capture(self.phase(target, bench)[0])
        return self.phase(target, bench)


class Deaf(Method):
    """Goes on after the display has ended it, and returns another phase than it has handed in."""

    def solve(self, target, bench):
        phase = self.phase(target, bench)
        bench.keep(phase)
        try:
            while True:
                bench.capture(phase[0])
        except Exception:
            return phase.fill_(9.0)


class Lying(Method):
    """Says of itself that the display has ended it."""

    def solve(self, target, bench):
        bench.keep(self.phase(target, bench)[0])
        raise BudgetError("the best of all methods")
