from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import pytest
import torch
from torch import Tensor

from holobench_eval.testing.contract import check_method


@dataclass(frozen=True)
class Good:
    value: float = 1.0
    camera: ClassVar[bool] = False

    def solve(self, target: Tensor, bench: Any) -> Tensor:
        shape = (*target.shape[:2], *bench.spec.shape)
        return self.value * torch.rand(shape, generator=bench.generator("start"))


@dataclass(frozen=True)
class Bare(Good):
    """Neither ``camera`` nor ``privileged``: both are optional."""


@dataclass(frozen=True)
class Array(Good):
    def solve(self, target: Tensor, bench: Any) -> Any:
        return super().solve(target, bench).double().numpy()


@dataclass(frozen=True)
class Levels(Good):
    def solve(self, target: Tensor, bench: Any) -> Any:
        return super().solve(target, bench).byte().numpy()


@dataclass(frozen=True)
class Photographing(Good):
    camera: ClassVar[bool] = True

    def solve(self, target: Tensor, bench: Any) -> Tensor:
        phases = super().solve(target, bench)
        for phase in phases:
            bench.capture(phase)
        return phases


@dataclass(frozen=True)
class Peeping(Good):
    def solve(self, target: Tensor, bench: Any) -> Tensor:
        bench.capture(super().solve(target, bench)[0])
        return super().solve(target, bench)


@dataclass(frozen=True)
class Random(Good):
    def solve(self, target: Tensor, bench: Any) -> Tensor:
        return torch.rand_like(super().solve(target, bench))


@dataclass(frozen=True)
class Changing(Good):
    def solve(self, target: Tensor, bench: Any) -> Tensor:
        target.sqrt_()
        return super().solve(target, bench)


@dataclass(frozen=True)
class Unbatched(Good):
    def solve(self, target: Tensor, bench: Any) -> Tensor:
        return super().solve(target, bench)[:1]


@dataclass(frozen=True)
class Broken(Good):
    def solve(self, target: Tensor, bench: Any) -> Tensor:
        return super().solve(target, bench) * float("nan")


@dataclass(frozen=True)
class Complex(Good):
    def solve(self, target: Tensor, bench: Any) -> Tensor:
        return torch.exp(1j * super().solve(target, bench))


@dataclass
class Loose:
    value: float = 1.0

    def solve(self, target: Tensor, bench: Any) -> Tensor:
        return Good().solve(target, bench)


@dataclass(frozen=True)
class Needy:
    value: float

    def solve(self, target: Tensor, bench: Any) -> Tensor:
        return Good().solve(target, bench)


@dataclass(frozen=True)
class Flagged(Good):
    privileged: bool = True


@dataclass(frozen=True)
class Unprepared(Good):
    trains: ClassVar[bool] = True


@dataclass(frozen=True)
class Untidy(Unprepared):
    def prepare(self, bench: Any) -> Any:
        return [bench.photograph(torch.zeros(3, *bench.spec.shape), bench.images[0])]


@pytest.mark.parametrize("method", [Good, Good(2.0), Bare, Array, Photographing])
def test_a_method_that_keeps_the_contract_passes(method: Any) -> None:
    check_method(method)


@pytest.mark.parametrize(
    ("method", "message"),
    [
        (Random, "not repeatable"),
        (Changing, "changed its target"),
        (Unbatched, r"returned \(1, 1, 64, 64\) for \(2, 1, 64, 64\)"),
        (Broken, "NaN or infinite"),
        (Complex, "not a phase in radians"),
        (Levels, "returned ndarray of uint8, not a plain torch.Tensor or a NumPy array of float32 or float64"),
        (Loose, "can be changed after it was made"),
        (Needy, "default for every parameter"),
        (Flagged, "must be a ClassVar"),
        (Unprepared, "has no method 'prepare'"),
        (Untidy, "prepare returned list, not a mapping"),
        (int, "not a dataclass"),
    ],
)
def test_a_broken_promise_is_named(method: Any, message: str) -> None:
    with pytest.raises(AssertionError, match=message):
        check_method(method)


def test_a_method_that_captures_without_a_camera_is_stopped() -> None:
    with pytest.raises(Exception, match="declares no camera"):
        check_method(Peeping)
