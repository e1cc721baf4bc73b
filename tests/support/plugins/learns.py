"""A method that learns values of every kind."""

from dataclasses import dataclass
from typing import ClassVar

import torch


@dataclass(frozen=True)
class Learns:
    trains: ClassVar[bool] = True
    odd: bool = False

    def prepare(self, bench):
        phase = torch.rand(
            (len(bench.spec.wavelengths), *bench.spec.shape), generator=bench.generator("phase", 1, ("a", 2.5))
        )
        seen = bench.photograph(phase, bench.images[0], "capture", 1, ("a", 2.5))
        held = bench.kept("means", lambda: {"mean": seen.mean()})
        bench.log(round=1, step=0, mean=float(held["mean"]))
        odd = {"odd": object()} if self.odd else {}
        return {"seen": seen, "held": held, 3: [1.5, None, "text", (1, True)], **odd}

    def solve(self, target, bench):
        assert list(bench.learned[3][:3]) == [1.5, None, "text"]
        light = bench.light.mean() + bench.learned["seen"].mean() + bench.learned["held"]["mean"]
        return torch.zeros((*target.shape[:2], *bench.spec.shape)) + light
