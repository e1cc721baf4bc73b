"""Every target reads damaged input or refuses it; ``python -m tests.fuzz`` does the same for long."""

import random
from contextlib import suppress

import pytest

from tests.fuzz.targets import REFUSALS, TARGETS

INPUTS = {"study": 20, "records.csv": 30}  # which are slow to read
OTHERS = 200
TOKENS = (b"[" * 3000, b"-1", b"1e999", b"null", b"\0", b"\xff", b"{", b"9" * 400, b"!!x ", b"&a ", b"*a")


def damaged(content: bytes, draw: random.Random) -> bytes:
    """A valid input with a few bytes changed, cut, doubled or moved."""
    whole = bytearray(content)
    for _ in range(draw.randint(1, 4)):
        at, length = draw.randrange(len(whole) + 1), draw.randint(1, 40)
        kind = draw.randrange(4)
        if kind == 0:
            whole[at : at + 1] = bytes([draw.randrange(256)])
        elif kind == 1:
            del whole[at : at + length]
        elif kind == 2:
            whole[at:at] = whole[at : at + length] * draw.randint(1, 50)
        else:
            whole[at:at] = draw.choice(TOKENS)
    return bytes(whole)


@pytest.mark.parametrize("name", TARGETS)
def test_what_is_to_begin_with_is_read(name, tmp_path):
    read = 0
    for content in TARGETS[name].begin():
        with suppress(*REFUSALS):
            TARGETS[name].run(content, tmp_path)
            read += 1
    assert read


@pytest.mark.filterwarnings("ignore::UserWarning")  # Pillow's, of tags
@pytest.mark.parametrize("name", TARGETS)
def test_damaged_input_is_read_or_refused(name, tmp_path):
    draw, inputs = random.Random(name), TARGETS[name].begin()
    for _ in range(INPUTS.get(name, OTHERS)):
        with suppress(*REFUSALS):
            TARGETS[name].run(damaged(draw.choice(inputs), draw), tmp_path)
