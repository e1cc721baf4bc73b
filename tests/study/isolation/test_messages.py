"""What is sent arrives as it was, and what is no message is refused."""

from __future__ import annotations

from contextlib import suppress
from multiprocessing import Pipe
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from holobench_eval.core.errors import CellError
from holobench_eval.display.api import Capture
from holobench_eval.study.isolation.messages import TYPES, Channel, GarbledError

SCALARS = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text()
VALUES = st.recursive(
    SCALARS,
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.lists(inner, max_size=4).map(tuple)
        | st.dictionaries(st.text() | st.integers(), inner, max_size=4)
    ),
    max_leaves=20,
)


def passed(value: Any) -> Any:
    ours, theirs = (Channel(end) for end in Pipe())
    ours.send(value)
    return theirs.receive()


def refused(*parts: bytes) -> None:
    ours, theirs = Pipe()
    for part in parts:
        ours.send_bytes(part)
    with pytest.raises(GarbledError):
        Channel(theirs).receive()


@given(VALUES)
def test_numbers_text_lists_and_mappings_arrive_as_they_were(value):
    assert passed(value) == value


@pytest.mark.parametrize("dtype", TYPES.values())
@pytest.mark.parametrize("shape", [(), (3,), (2, 0), (2, 3, 4)])
def test_tensors_of_every_type_and_shape_arrive_to_the_bit(dtype, shape):
    tensor = (torch.rand(shape, generator=torch.Generator().manual_seed(1)) * 9).to(dtype)
    found = passed({"here": [tensor, tensor.mT if tensor.ndim > 1 else tensor]})["here"]
    assert found[0].dtype == dtype
    assert torch.equal(found[0], tensor)
    assert torch.equal(found[1], tensor.mT if tensor.ndim > 1 else tensor)


def test_a_capture_arrives_without_its_gradient():
    frame = torch.ones(1, 2, 2).requires_grad_()
    found = passed(Capture(frame * 2, 0.0, 9.0, (1.0,)))
    assert isinstance(found, Capture)
    assert found.gain == (1.0,)
    assert not found.frame.requires_grad


class Odd(torch.Tensor):
    pass


@pytest.mark.parametrize("value", [torch.zeros(2).as_subclass(Odd), lambda: None, np.zeros(2)])
def test_what_cannot_be_sent_is_refused_where_it_is_and_leaves_nothing_behind(value):
    ours, theirs = (Channel(end) for end in Pipe())
    with pytest.raises(CellError, match=r"a value is (Odd|function|ndarray of float64); expected tensors"):
        ours.send([torch.ones(1), {"a": value}])
    ours.send(1)
    assert theirs.receive() == 1


@pytest.mark.parametrize(
    "header",
    [
        b"\x80\x04",
        b"[" * 200_000,
        b"[]",
        b'["tensor"]',
        b'["tensor", "float32", [-1]]',
        b'["tensor", "float32", [1000000, 1000000]]',
        b'["tensor", "object", [1]]',
        b'["class", "Popen", ["dict"]]',
        b'["class", "Capture", ["dict", ["frame", 1]]]',
        b'["dict", [["list"], 1]]',
        b'["module", "os"]',
    ],
)
def test_what_is_no_message_is_refused(header):
    refused(header)


@pytest.mark.parametrize("content", [b"12", bytes(12), bytes(17)])
def test_a_tensor_with_too_few_or_too_many_bytes_is_refused(content):
    refused(b'["tensor", "float32", [4]]', content)


@given(st.binary(max_size=200))
def test_no_bytes_do_anything_but_be_refused_or_read(content):
    ours, theirs = Pipe()
    ours.send_bytes(content)
    ours.close()
    with suppress(GarbledError, EOFError):  # a value by chance, or the end where a tensor should follow
        Channel(theirs).receive()
