"""A device that hangs, fails or is closed is told in one line, in time."""

import threading
import time

import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.lab.devices import DeviceError
from holobench_eval.lab.drivers.worker import Worker
from tests.support.patience import PATIENCE


def test_every_call_and_the_idling_between_are_on_one_thread_that_is_not_the_callers() -> None:
    idled: list[int] = []
    worker = Worker("panel", idle=lambda: idled.append(threading.get_ident()))
    threads = {worker.call("a call", PATIENCE, threading.get_ident) for _ in range(3)}
    deadline = time.monotonic() + PATIENCE
    while not idled and time.monotonic() < deadline:
        time.sleep(0.01)
    worker.stop(1, lambda: None)
    assert threads == set(idled)
    assert threads != {threading.get_ident()}


def test_a_call_that_never_returns_is_left_behind_and_the_device_is_not_asked_again() -> None:
    worker, forever = Worker("camera"), threading.Event()
    began = time.monotonic()
    with pytest.raises(DeviceError, match=r"camera: taking a picture took longer than 0\.2 s"):
        worker.call("taking a picture", 0.2, forever.wait)
    with pytest.raises(DeviceError, match="took longer"):
        worker.call("taking a picture", PATIENCE, lambda: None)
    worker.stop(PATIENCE, forever.wait)
    assert time.monotonic() - began < PATIENCE / 2
    forever.set()


def test_what_a_library_raises_becomes_one_line_and_users_errors_stay() -> None:
    def broken(error: Exception) -> None:
        raise error

    worker = Worker("camera")
    with pytest.raises(DeviceError, match=r"^camera: reading failed: OSError: a b$"):
        worker.call("reading", 5, lambda: broken(OSError("a\n  b")))
    with pytest.raises(DeviceError, match="reading failed: TimeoutError"):
        worker.call("reading", 5, lambda: broken(TimeoutError("its own")))
    with pytest.raises(UserError, match=r"^no such camera$"):
        worker.call("reading", 5, lambda: broken(UserError("no such camera")))
    assert worker.call("reading", 5, lambda: 7) == 7
    worker.stop(5, lambda: broken(OSError()))
    with pytest.raises(DeviceError, match="camera is closed"):
        worker.call("reading", 5, lambda: 7)
