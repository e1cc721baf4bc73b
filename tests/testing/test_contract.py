from collections.abc import Callable
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


def changed(change: Callable[[Tensor, Tensor, Any], Any]) -> type[Good]:
    """A method like ``Good``, but for what becomes of its phase, given its target and bench too."""

    @dataclass(frozen=True)
    class Changed(Good):
        def solve(self, target: Tensor, bench: Any) -> Any:
            return change(super().solve(target, bench), target, bench)

    return Changed


def photographed(phases: Tensor, target: Tensor, bench: Any) -> Tensor:
    for phase in phases:
        bench.capture(phase)
    return phases


class Photographing(changed(photographed)):  # type: ignore[misc]
    camera: ClassVar[bool] = True


def spoiled(phases: Tensor, target: Tensor, bench: Any) -> Tensor:
    target.sqrt_()
    return phases


@dataclass
class Loose:
    value: float = 1.0
    solve = Good.solve


@dataclass(frozen=True)
class Needy:
    value: float
    solve = Good.solve


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


@pytest.mark.parametrize("method", [Good, Good(2.0), changed(lambda phase, *_: phase.double().numpy()), Photographing])
def test_a_method_that_keeps_the_contract_passes(method):
    check_method(method)


@pytest.mark.parametrize(
    ("method", "message"),
    [
        (changed(lambda phase, *_: torch.rand_like(phase)), "not repeatable"),
        (changed(spoiled), "changed its target"),
        (changed(lambda phase, *_: phase[:1]), r"returned \(1, 1, 64, 64\) for \(2, 1, 64, 64\)"),
        (changed(lambda phase, *_: phase * float("nan")), "NaN or infinite"),
        (changed(lambda phase, *_: torch.exp(1j * phase)), "not a phase in radians"),
        (changed(lambda phase, *_: phase.byte().numpy()), "returned ndarray of uint8, not a plain torch.Tensor or a"),
        (Loose, "can be changed after it was made"),
        (Needy, "default for every parameter"),
        (Flagged, "must be a ClassVar"),
        (Unprepared, "has no method 'prepare'"),
        (Untidy, "prepare returned list, not a mapping"),
        (int, "not a dataclass"),
    ],
)
def test_a_broken_promise_is_named(method, message):
    with pytest.raises(AssertionError, match=message):
        check_method(method)


def test_a_method_that_captures_without_a_camera_is_stopped():
    with pytest.raises(Exception, match="declares no camera"):
        check_method(changed(photographed))
