"""Other processes of this machine: how they are started, without threads of their libraries and deaf to Ctrl-C."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import forkserver, get_all_start_methods, get_context, resource_tracker
from multiprocessing.process import BaseProcess, current_process
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

# Set while that process starts, so that it takes no file of the working directory, such as random.py, for a module.
SAFE_PATH, OURS = "PYTHONSAFEPATH", "holobench_eval"
J = TypeVar("J")  # a job
R = TypeVar("R")  # its result
ONE_THREAD = {"OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
# By the process that others are forked from; torch's optimisers import the last at their first use, in over a second.
PRELOADED = ["holobench_eval.study.executors.imported", "holobench_eval.study.running.run", "torch._dynamo"]
# Not on Windows, nor where libraries of the system do not bear a fork: every process imports on its own there.
FORKS = "forkserver" in get_all_start_methods() and sys.platform != "darwin"
CONTEXT = get_context("forkserver") if FORKS else get_context("spawn")


def start(function: Callable[..., None], *arguments: Any) -> BaseProcess:
    """A process that runs a function and ends with this one."""
    # A worker may itself be a process that ends with another, which multiprocessing lets start none.
    current_process()._config["daemon"] = False  # type: ignore[attr-defined]
    process = CONTEXT.Process(target=function, args=arguments, daemon=True)
    prepare()
    with _without_main():
        process.start()
    return process


@contextmanager
def _without_main() -> Iterator[None]:
    """Else the process would begin with the user's script, which may have no ``if __name__ == "__main__"``."""
    main, sys.modules["__main__"] = sys.modules["__main__"], ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


def prepare() -> None:
    """Start the process that workers are forked from, where it does not run; its imports take more than a second."""
    server: Any = forkserver._forkserver
    if server._forkserver_pid is None and server._forkserver_address is not None:
        # Forked by a server, which serves this process, too: one of its own would import all again.
        server.ensure_running = lambda: None
    elif FORKS:
        CONTEXT.set_forkserver_preload(PRELOADED)
        own = os.environ.setdefault(SAFE_PATH, OURS)
        resource_tracker.ensure_running()  # now, since it lets Ctrl-C through as it starts
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # never seen there, not even in its imports
        try:
            forkserver.ensure_running()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            if own == OURS:
                del os.environ[SAFE_PATH]


def children(number: int) -> list[int]:
    """Numbers of the processes that a process has started, in ``/proc``; none elsewhere."""
    listed = list[int]()
    for file in Path(f"/proc/{number}").glob("task/*/children"):
        with suppress(OSError):
            listed += map(int, file.read_text().split())
    return listed


def descendants(number: int) -> list[int]:
    """Numbers of the processes that a process and those have started."""
    return [each for child in children(number) for each in (child, *descendants(child))]


def cpu_of(number: int) -> float:
    """Processor time [s] of a process, and of those it has waited for. OSError where it has ended."""
    # clock_getcpuclockid(3): the clock of another process; those that ended and were waited for are counted in ticks.
    waited = Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[13:15]
    return time.clock_gettime(~number << 3 | 2) + sum(map(int, waited)) / os.sysconf("SC_CLK_TCK")


def number_within(number: int) -> int:
    """The number that a process has for itself in its namespace, 0 where it has ended."""
    with suppress(OSError, StopIteration):
        lines = Path(f"/proc/{number}/status").read_text().splitlines()
        return int(next(line for line in lines if line.startswith("NSpid:")).split()[-1])
    return 0
