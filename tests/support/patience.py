"""How long tests wait for what must come."""

import signal
import time
from collections.abc import Callable
from typing import Any

from holobench_eval.study.executors.processes import start

PATIENCE = 600.0
"""Seconds: far more than anything takes on the busiest machine, so that only what hangs runs out of it."""


def wait_until(reached: Callable[[], bool]) -> None:
    """Wait for what must come."""
    deadline = time.monotonic() + PATIENCE
    while not reached():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def killed_at(reached: Callable[[], bool], function: Callable[..., None], *arguments: Any) -> None:
    """Run a function in a process, and kill that when something is reached."""
    process = start(function, *arguments)
    wait_until(lambda: reached() or not process.is_alive())
    process.kill()
    process.join(PATIENCE)
    assert process.exitcode == -signal.SIGKILL
