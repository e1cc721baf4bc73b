"""Other processes of this machine: how they are started, without threads of their libraries and deaf to Ctrl-C."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable
from multiprocessing import forkserver, get_all_start_methods, get_context, resource_tracker
from multiprocessing.process import BaseProcess, current_process
from typing import Any, TypeVar

J = TypeVar("J")  # a job
R = TypeVar("R")  # its result
ONE_THREAD = {"OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
# By the process that others are forked from; torch's optimisers import the last at their first use, in over a second.
PRELOADED = ["holobench_eval.study.executors.imported", "holobench_eval.study.run", "torch._dynamo"]
# Not on Windows, nor where libraries of the system do not bear a fork: every process imports on its own there.
FORKS = "forkserver" in get_all_start_methods() and sys.platform != "darwin"
CONTEXT = get_context("forkserver") if FORKS else get_context("spawn")


def start(function: Callable[..., None], *arguments: Any) -> BaseProcess:
    """A process that runs a function and ends with this one."""
    # A worker may itself be a process that ends with another, which multiprocessing lets start none.
    current_process()._config["daemon"] = False  # type: ignore[attr-defined]
    process = CONTEXT.Process(target=function, args=arguments, daemon=True)
    prepare()
    process.start()
    return process


def prepare() -> None:
    """Start the process that workers are forked from, where it does not run; its imports take more than a second."""
    server: Any = forkserver._forkserver
    if server._forkserver_pid is None and server._forkserver_address is not None:
        # Forked by a server, which serves this process, too: one of its own would import all again.
        server.ensure_running = lambda: None
    elif FORKS:
        CONTEXT.set_forkserver_preload(PRELOADED)
        resource_tracker.ensure_running()  # now, since it lets Ctrl-C through as it starts
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # never seen there, not even in its imports
        try:
            forkserver.ensure_running()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
