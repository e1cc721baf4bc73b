"""A process goes on in namespaces of its own, whole, or nothing has changed."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.support.patience import PATIENCE

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="namespaces are of Linux")

CODE = """
import os
from pathlib import Path
from types import SimpleNamespace
from holobench_eval.study.isolation import namespace

def forbidden(*_):
    raise OSError

before, libc = (os.getpid(), os.geteuid(), os.getegid()), namespace.libc
{change}
is_enclosed = namespace.enter()
after = os.getpid(), os.geteuid(), os.getegid()
numbers = [path.name for path in Path("/proc").iterdir() if path.name.isdigit()]
print(is_enclosed, after == before, after[1:] == before[1:], after[0] == 1, len(numbers))
"""
REFUSALS = {
    "unshare": "namespace.libc = SimpleNamespace(unshare=lambda _: -1)",
    "maps": "namespace._map = forbidden",
    "groups": "namespace.Path = lambda *_: SimpleNamespace(write_text=forbidden)",
    "/proc": "namespace.libc = SimpleNamespace(unshare=libc.unshare, prctl=libc.prctl, mount=lambda *_: -1)",
}


def entered(change: str) -> list[str]:
    code = CODE.format(change=change)
    done = subprocess.run([sys.executable, "-c", code], timeout=PATIENCE, capture_output=True, text=True, check=True)
    return done.stdout.split()


@pytest.mark.parametrize("refusal", REFUSALS)
def test_where_a_part_is_forbidden_nothing_changes(refusal: str) -> None:
    assert entered(REFUSALS[refusal])[:3] == ["False", "True", "True"]


def test_else_no_other_process_is_there() -> None:
    is_enclosed, _, same_user, first, numbers = entered("")
    if is_enclosed == "False":
        pytest.skip("this system allows no namespaces")
    assert (same_user, first, numbers) == ("True", "True", "1")
