"""The benchmarks of a checkout, ``tests/benchmarks``, and the processes that time them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from random import Random
from types import TracebackType
from typing import Any, NamedTuple, Self, TypeVar

from ..core.errors import UserError

THREADS = 2
CHECKOUT = Path(__file__).parents[2]
INSTALL = "pip install -c constraints.txt -e '.[dev]' ('.[dev,peers]' to time others' code, too)"
# glibc's heap keeps all memory and maps none: read by it when a process begins, and so right for every thread of it.
STEADY = {"MALLOC_MMAP_MAX_": "0", "MALLOC_TRIM_THRESHOLD_": str(2**40)}
FRESH: Mapping[str, str] = {}
Answer = dict[str, Any]
Key = TypeVar("Key")


class MissingError(LookupError):
    """A module that a case needs is not installed; its name is the second argument."""


class Case(NamedTuple):
    """A benchmark: group and version of it, and whether it has a process of its own."""

    group: str
    version: str
    apart: bool

    @property
    def name(self) -> str:
        """As its worker knows it."""
        return f"{self.group} | {self.version}"


def suite() -> Path:
    """Folder of the benchmarks. UserError: the package does not lie in a checkout."""
    folder = CHECKOUT / "tests" / "benchmarks"
    if not (folder / "cases.py").is_file():
        raise UserError(f"no benchmarks in {folder}; in a checkout: {INSTALL}")
    return folder


def cases(only: str) -> list[Case]:
    """The benchmarks whose names hold a text. UserError: none does."""
    command = [sys.executable, str(suite() / "worker.py"), "--names"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise UserError(f"the benchmarks cannot be listed: {(done.stderr.splitlines() or ['no reason given'])[-1]}")
    matching = [case for row in json.loads(done.stdout) if only in (case := Case(*row)).name]
    if not matching:
        raise UserError(f"no benchmark's name holds '{only}'")
    return matching


class Worker:
    """A process that times benchmarks on request, see its file; it ends when it is left.

    Parameters
    ----------
    options
        ``--steady SEED``, ``--fresh`` or ``--from FOLDER SEED``.
    cache
        Folder for what the process keeps between runs.
    benchmarks
        Folder of the benchmarks.
    heap
        Settings of its heap, ``STEADY`` or ``FRESH``.
    """

    def __init__(
        self, *options: str, cache: Path, benchmarks: Path | None = None, heap: Mapping[str, str] = FRESH
    ) -> None:
        command = [sys.executable, str((benchmarks or suite()) / "worker.py"), *options]
        surroundings = os.environ | {"XDG_CACHE_HOME": str(cache)} | dict(heap)
        surroundings.pop("OMP_NUM_THREADS", None)  # every case says how many
        pipe, none = subprocess.PIPE, subprocess.DEVNULL
        self.ended = False
        self.process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=none, text=True, env=surroundings)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if kind is not None:
            self.process.kill()
        assert self.process.stdin is not None
        with suppress(BrokenPipeError):
            self.process.stdin.close()  # which ends it
        self.process.__exit__(kind, error, at)

    def send(self, name: str, request: int | str) -> None:
        """Ask for something, and do not wait for it."""
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(f"{name}\t{request}\n")
            self.process.stdin.flush()
        except BrokenPipeError:
            return  # who waits for the answer is told

    def receive(self) -> Answer:
        """The answer to what was asked for. LookupError, or MissingError: there is none, with the reason."""
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        self.ended = not line
        answer: Answer = json.loads(line or '{"error": "the process ended"}')
        if "missing" in answer:
            raise MissingError(answer["error"], answer["missing"])
        if "error" in answer:
            raise LookupError(answer["error"])
        return answer

    def ask(self, name: str, request: int | str) -> Answer:
        """Ask and wait."""
        self.send(name, request)
        return self.receive()


def in_turns(
    versions: Mapping[Key, Callable[[], Answer]], draw: Random, seconds: float, fewest: int, most: int
) -> list[dict[Key, Answer]]:
    """Answers of all versions, turn by turn, in another order each, until the seconds have passed."""
    began, turns = time.monotonic(), list[dict[Key, Answer]]()
    while len(turns) < fewest or (len(turns) < most and time.monotonic() - began < seconds):
        turns.append({key: versions[key]() for key in draw.sample(list(versions), len(versions))})
    return turns
