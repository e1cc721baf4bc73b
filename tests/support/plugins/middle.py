"""A method of focal stacks."""

from dataclasses import dataclass
from typing import ClassVar

from holobench_eval.methods.wirtinger import Wirtinger


@dataclass(frozen=True)
class Middle(Wirtinger):
    """One hologram for all planes that knows the middle one alone."""

    planes: ClassVar[bool] = True

    def solve_planes(self, targets, offsets, bench):
        assert offsets[1] == 0
        return self.solve(targets[1:2], bench)[0]
