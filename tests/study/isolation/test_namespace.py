"""A process goes on in namespaces of its own, whole, or nothing has changed."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.support.patience import PATIENCE

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="namespaces are of Linux")

REFUSALS = {
    "nothing": "",
    "unshare": "namespace.libc = SimpleNamespace(unshare=lambda _: -1)",
    "maps": "namespace._map = forbidden",
    "groups": "namespace.Path = lambda *_: SimpleNamespace(write_text=forbidden)",
    "/proc": "namespace.libc = SimpleNamespace(unshare=libc.unshare, prctl=libc.prctl, mount=lambda *_: -1)",
}
CODE = f"""
import os
from pathlib import Path
from types import SimpleNamespace
from holobench_eval.study.isolation import namespace

def forbidden(*_):
    raise OSError

libc = namespace.libc
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


@pytest.mark.parametrize("refusal", ["unshare", "maps", "groups", "/proc"])
def test_where_a_part_is_forbidden_nothing_changes(entered, refusal):
    assert entered[refusal][:3] == ["False", "True", "True"]


def test_else_no_other_process_is_there(entered):
    is_enclosed, _, same_user, first, numbers = entered["nothing"]
    if is_enclosed == "False":
        pytest.skip("this system allows no namespaces")
    assert (same_user, first, numbers) == ("True", "True", "1")
