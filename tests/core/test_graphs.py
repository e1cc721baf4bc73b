"""Steps are recorded and replayed where they can be, and run as they are elsewhere."""

from collections.abc import Callable

import numpy as np
import pytest
import torch
from torch import Tensor

from holobench_eval.core.device import CPU
from holobench_eval.core.graphs import WARM_UP, is_recorded, repeated
from tests.support.benches.replaying import Traffic, fake_device


class Count:
    """What steps change: a number in one place in memory."""

    def __init__(self) -> None:
        self.value = torch.zeros(3)
        self.calls = 0

    def in_place(self) -> Tensor:
        self.calls += 1
        self.value += 1
        return self.value * 2

    def elsewhere(self) -> Tensor:
        self.value = self.value + 1
        return self.value * 2

    def branching(self) -> Tensor:
        if self.value[0] < 100:
            self.value += 1
        return self.value * 2

    def masked(self) -> Tensor:
        chosen = self.value < 100
        self.value[chosen] = self.value[chosen] + 1
        return self.value * 2

    def from_numbers(self) -> Tensor:
        self.value += torch.tensor([1.0, 1.0, 1.0])
        return self.value * 2

    def in_numpy(self) -> Tensor:
        values = self.value.numpy()
        np.add(values, 1, out=values)
        return self.value * 2


def after(calls: int, step: Callable[[Count], Tensor]) -> tuple[list[float], Count]:
    """What each of so many calls of a repeated step returns."""
    count = Count()
    again = repeated(lambda: step(count), CPU)
    return [float(again()[0]) for _ in range(calls)], count


RIGHT = [2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0]


def test_a_step_is_recorded_once_and_each_call_is_one_step() -> None:
    with fake_device() as cuda:
        returned, count = after(7, Count.in_place)
    assert returned == RIGHT
    assert (cuda.watches, cuda.records, cuda.replays) == (1, 1, 7 - WARM_UP - 1)
    assert cuda.waits == [("own", "usual"), ("usual", "own")] * (WARM_UP + 1)  # around every run on another stream
    assert count.calls == WARM_UP + 2  # Python has run for the last time when the step was recorded


@pytest.mark.parametrize("step", [Count.branching, Count.masked, Count.from_numbers])
def test_a_step_that_waits_for_the_device_runs_as_it_is(step: Callable[[Count], Tensor]) -> None:
    with fake_device() as cuda:
        assert after(7, step)[0] == RIGHT
    assert (cuda.watches, cuda.records) == (1, 0)
    assert cuda.waits == [("own", "usual"), ("usual", "own")] * (WARM_UP + 1)
    assert cuda.get_sync_debug_mode() == 0


def test_a_step_that_cannot_be_recorded_runs_as_it_is() -> None:
    with fake_device(records=False) as cuda:
        assert after(7, Count.in_place)[0] == RIGHT
    assert cuda.replays == 0
    assert cuda.current is cuda.usual


@pytest.mark.parametrize("step", [Count.elsewhere, Count.in_numpy])
def test_the_fake_device_shows_what_a_graph_would_not_repeat(step: Callable[[Count], Tensor]) -> None:
    """A result that is put elsewhere, and work that torch does not do."""
    with fake_device():
        assert after(7, step)[0] != RIGHT


def test_on_the_cpu_it_is_the_step_itself_and_elsewhere_an_error_of_the_step_is_raised() -> None:
    def step() -> None:
        raise ValueError("no light")

    assert repeated(step, CPU) is step
    assert not is_recorded(CPU)
    with fake_device(), pytest.raises(ValueError, match="no light"):
        repeated(step, CPU)()


def test_traffic_is_what_operations_read_and_write() -> None:
    x = torch.zeros(10)  # 40 bytes
    with Traffic() as traffic:
        y = torch.empty(10)
        torch.mul(x, 2, out=y).add_(x[:5].sum())
        y.copy_(x)
    assert traffic.bytes == (40 + 40) + (20 + 4) + (40 + 4 + 40) + (40 + 40)
