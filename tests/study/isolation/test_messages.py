"""What is sent to a process arrives as it was, what is no message is refused; its namespaces are whole or none."""

import subprocess
import sys
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
from tests.support.patience import PATIENCE

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


@given(VALUES)
def test_numbers_text_lists_and_mappings_arrive_as_they_were(value):
    assert passed(value) == value


@pytest.mark.parametrize("dtype", TYPES.values())
@pytest.mark.parametrize("shape", [(), (3,), (2, 0), (2, 3, 4)])
def test_tensors_of_every_type_and_shape_arrive_to_the_bit(dtype, shape):
    tensor = (torch.rand(shape, generator=torch.Generator().manual_seed(1)) * 9).to(dtype)
    sent = [tensor, tensor.mT if tensor.ndim > 1 else tensor]
    found = passed({"here": sent})["here"]
    assert found[0].dtype == dtype
    assert all(map(torch.equal, found, sent))


def test_a_capture_arrives_without_its_gradient():
    frame = torch.ones(1, 2, 2).requires_grad_()
    found = passed(Capture(frame * 2, 0.0, 9.0, (1.0,)))
    assert (type(found), found.gain, found.frame.requires_grad) == (Capture, (1.0,), False)


class Odd(torch.Tensor):
    pass


@pytest.mark.parametrize("value", [torch.zeros(2).as_subclass(Odd), lambda: None, np.zeros(2)])
def test_what_cannot_be_sent_is_refused_where_it_is_and_leaves_nothing_behind(value):
    ours, theirs = (Channel(end) for end in Pipe())
    with pytest.raises(CellError, match=r"a value is (Odd|function|ndarray of float64); expected tensors"):
        ours.send([torch.ones(1), {"a": value}])
    ours.send(1)
    assert theirs.receive() == 1


HEADERS = [
    *(b"\x80\x04", b"[" * 200_000, b"[]", b'["tensor"]', b'["tensor", "float32", [-1]]', b'["module", "os"]'),
    *(b'["tensor", "float32", [1000000, 1000000]]', b'["tensor", "object", [1]]', b'["class", "Popen", ["dict"]]'),
    *(b'["class", "Capture", ["dict", ["frame", 1]]]', b'["dict", [["list"], 1]]'),
]
LENGTHS = [(b'["tensor", "float32", [4]]', bytes(length)) for length in (2, 12, 17)]  # of 16 bytes


@pytest.mark.parametrize("parts", [*((header,) for header in HEADERS), *LENGTHS])
def test_what_is_no_message_and_a_tensor_with_too_few_or_too_many_bytes_are_refused(parts):
    ours, theirs = Pipe()
    for part in parts:
        ours.send_bytes(part)
    with pytest.raises(GarbledError):
        Channel(theirs).receive()


@given(st.binary(max_size=200))
def test_no_bytes_do_anything_but_be_refused_or_read(content):
    ours, theirs = Pipe()
    ours.send_bytes(content)
    ours.close()
    with suppress(GarbledError, EOFError):  # a value by chance, or the end where a tensor should follow
        Channel(theirs).receive()


on_linux = pytest.mark.skipif(sys.platform != "linux", reason="namespaces are of Linux")

REFUSALS = {
    "nothing": "",
    "unshare": "namespace.libc = SimpleNamespace(unshare=lambda _: -1)",
    "below": "namespace.libc = SimpleNamespace(**kept, unshare=lambda of: libc.unshare(of) if of & NEWPID else -1)",
    "maps": "namespace.Path = lambda *_: SimpleNamespace(write_text=forbidden)",
    "/proc": "namespace.libc = SimpleNamespace(**kept | {'mount': lambda *_: -1}, unshare=libc.unshare)",
}
CODE = f"""
import os
from pathlib import Path
from types import SimpleNamespace
from holobench_eval.study.isolation import namespace

def forbidden(*_):
    raise OSError

libc, NEWPID = namespace.libc, namespace.CLONE_NEWPID
kept = {{"mount": libc.mount, "prctl": libc.prctl}}
for name, change in {REFUSALS}.items():
    if child := os.fork():
        os.waitpid(child, 0)
        continue
    before = (os.getpid(), os.geteuid(), os.getegid())
    exec(change)
    is_enclosed = namespace.enter()
    after = os.getpid(), os.geteuid(), os.getegid()
    numbers = [path.name for path in Path("/proc").iterdir() if path.name.isdigit()]
    print(name, is_enclosed, after == before, after[1:] == before[1:], after[0] == 1, len(numbers), flush=True)
    os._exit(0)
"""


@pytest.fixture(scope="module")
def entered():
    """What is found where each part is forbidden."""
    command = [sys.executable, "-c", CODE]
    done = subprocess.run(command, timeout=PATIENCE, capture_output=True, text=True, check=True)
    return {line.split()[0]: line.split()[1:] for line in done.stdout.splitlines()}


@on_linux
@pytest.mark.parametrize("refusal", ["unshare", "below", "maps", "/proc"])
def test_where_a_part_is_forbidden_nothing_changes(entered, refusal):
    assert entered[refusal][:3] == ["False", "True", "True"]


@on_linux
def test_else_no_other_process_is_there(entered):
    is_enclosed, _, same_user, first, numbers = entered["nothing"]
    if is_enclosed == "False":
        pytest.skip("this system allows no namespaces")
    assert (same_user, first, numbers) == ("True", "True", "1")
