"""Methods that change the harness, and an honest one."""

from dataclasses import dataclass

import torch

from holobench_eval.metrics import protocol


@dataclass(frozen=True)
class Honest:
    def solve(self, target, bench):
        return torch.zeros((*target.shape[:2], *bench.spec.shape))


@dataclass(frozen=True)
class Flatterer(Honest):
    def solve(self, target, bench):
        refine = protocol.match
        protocol.match = lambda image, target, *more, **named: (target, refine(image, target, *more, **named)[1])
        return super().solve(target, bench)


@dataclass(frozen=True)
class Silencer(Honest):
    def solve(self, target, bench):
        torch.randn = lambda *shape, **options: torch.zeros(*shape)
        return super().solve(target, bench)


@dataclass(frozen=True)
class Failing(Honest):
    def solve(self, target, bench):
        torch.randn = lambda *shape, **options: torch.zeros(*shape)
        raise ValueError("and then it fails")
