"""The one line that a failure is told in, digests, and functions that are compiled or recorded where they can be."""

import math
from collections.abc import Callable

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from holobench_eval.core import compiled, errors
from holobench_eval.core.device import CPU
from holobench_eval.core.graphs import WARM_UP, is_recorded, repeated
from holobench_eval.core.hashing import canonical, digest
from holobench_eval.report.text import words
from tests.support.benches.replaying import Traffic, fake_device


def test_an_error_is_told_with_the_name_of_its_class_unless_it_is_of_this_package() -> None:
    for kind in (errors.BudgetError, errors.CellError, errors.StorageError, errors.UserError):
        assert errors.reason(kind("registration residual of 1.3 px")) == "registration residual of 1.3 px"
    assert errors.reason(ValueError("no light")) == "ValueError: no light"
    told = type("LinAlgError", (errors.ForeignError,), {})
    assert errors.reason(told("singular matrix")) == "LinAlgError: singular matrix"


def test_a_reason_is_one_short_line_and_never_empty() -> None:
    assert errors.reason(errors.CellError("two\n  lines \udcff")) == "two lines \\udcff"
    assert len(errors.reason(errors.CellError("x" * 400))) == 300
    assert errors.reason(errors.CellError()) == errors.reason(errors.UserError(" \n")) == "no reason given"
    assert errors.reason(KeyboardInterrupt()) == "KeyboardInterrupt:"


def test_words_that_hold_commas_are_told_apart() -> None:
    assert errors.suggest("x", ("b", "a")) == "allowed: a, b"
    assert errors.suggest("x", ("wirtinger", "sgd, tuned")) == "allowed: sgd, tuned; wirtinger"


@pytest.mark.parametrize(
    ("names", "text"),
    [
        ([], ""),
        (["a, x"], "a, x"),
        (["a", "b", "c"], "a, b and c"),
        (["a, x 1", "a, x 2"], "a, x 1; and a, x 2"),
        (["a", "b, x", "c"], "a; b, x; and c"),
        (["a (0.1 dB [0.0, 0.2], p = 1)", "b [1, 2]"], "a (0.1 dB [0.0, 0.2], p = 1) and b [1, 2]"),
    ],
)
def test_a_list_in_a_sentence_is_read_in_one_way(names: list[str], text: str) -> None:
    assert words(names) == text
    assert errors.listed(names) == text.replace("; and ", "; ").replace(" and ", ", ")


PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)


def test_a_digest_does_not_change_between_versions() -> None:
    assert digest({"b": [1, 2.5, "x"], "a": None}) == "cacedc786abc936ff5388c20aad7a580a43bd81efb4e8df98d138f3816b04bab"


@settings(max_examples=50)
@given(st.dictionaries(st.text(), PLAIN, max_size=5))
def test_a_digest_does_not_depend_on_the_order_of_keys(description: dict[str, object]) -> None:
    assert digest(dict(reversed(description.items()))) == digest(description)


@pytest.mark.parametrize("odd", [math.nan, math.inf, object(), b"bytes"])
def test_what_is_not_plain_has_no_digest(odd: object) -> None:
    with pytest.raises(errors.UserError, match="not a plain description"):
        canonical({"a": odd})


def test_a_gradient_or_another_device_needs_the_uncompiled_form():
    plain, differentiated = torch.zeros(2), torch.zeros(2, requires_grad=True)
    assert compiled.usable(plain)
    assert not compiled.usable(plain, differentiated)
    with torch.no_grad():
        assert compiled.usable(differentiated)
    assert not compiled.usable(torch.zeros(2, device="meta"))


def test_a_function_is_compiled_without_a_folder_for_a_cache_and_stays_as_it_is_without_numba(monkeypatch):
    def double(x):
        return 2 * x

    def refuse(cache=False, **options):  # as Numba does where it finds no folder for its cache
        if cache:
            raise RuntimeError("cannot cache function: no locator available")
        return lambda function: "compiled each time"

    assert compiled.compiled(double) is not double
    with monkeypatch.context() as without_folder:
        without_folder.setattr(compiled, "_compile", refuse)
        assert compiled.compiled(double) == "compiled each time"
    monkeypatch.setattr(compiled, "AVAILABLE", False)
    assert compiled.compiled(double) is double
    assert not compiled.usable()


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
