"""A bench for methods that see no camera."""

from typing import Any

import torch

from holobench_eval.display import DisplaySpec


class Bench:
    """Nominal optics and random numbers, and nothing kept."""

    def __init__(self, spec: DisplaySpec) -> None:
        self.spec = spec

    def generator(self, *names: object) -> torch.Generator:
        return torch.Generator().manual_seed(len(repr(names)))

    def solved(self, method: Any, target: torch.Tensor) -> torch.Tensor:
        return method.solve(target, self)
