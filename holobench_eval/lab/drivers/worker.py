"""One thread for one device, so that a library that never comes back cannot hold up the study for ever."""

from __future__ import annotations

import contextlib
import queue
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from typing import Any, TypeVar

from ...core.errors import UserError
from ..devices import DeviceError

T = TypeVar("T")

TICK = 0.05  # seconds between two calls of `idle`


class Worker:
    """Runs the calls of one device, all on the same thread, each no longer than it may take.

    Windows, contexts of OpenGL and many vendors' libraries belong to the thread that opened them. A call that takes
    too long is left behind in its thread, and every later one is refused: nobody knows what state the device is in.
    idle: called between the calls, some twenty times a second, for libraries that want to be looked after.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.idle: Callable[[], None] | None = None
        self._lost: str | None = None
        self._tasks: queue.Queue[tuple[Future[Any], Callable[[], Any]] | None] = queue.Queue()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def call(self, what: str, seconds: float, function: Callable[[], T]) -> T:
        """What ``function`` returns. DeviceError, in one line, if it takes longer than ``seconds`` or fails.

        what: the action, for the error (``"taking a picture"``). UserError and DeviceError pass through.
        """
        if self._lost:
            raise DeviceError(self._lost)
        future: Future[T] = Future()
        self._tasks.put((future, function))
        try:
            return future.result(timeout=seconds)
        except (UserError, DeviceError):
            raise
        except BaseException as error:
            if future.done():  # the function's own, sys.exit() among them
                raise DeviceError(f"{self.name}: {what} failed: {line(error)}") from error
            if not isinstance(error, TimeoutError):
                raise
            self._lost = (
                f"{self.name}: {what} took longer than {seconds:.3g} s; look at its cable and power, start again"
            )
            raise DeviceError(self._lost) from None

    def stop(self, seconds: float, function: Callable[[], Any]) -> None:
        """Call ``function`` a last time and end the thread; whatever goes wrong is past caring. Again does nothing."""
        if self._lost is None:
            with contextlib.suppress(UserError, DeviceError):
                self.call("closing", seconds, function)
        self._lost = f"{self.name} is closed"
        self._tasks.put(None)

    def _run(self) -> None:
        while True:
            try:
                task = self._tasks.get(timeout=TICK if self.idle else None)
            except queue.Empty:
                self._rest()
                continue
            if task is None:
                return
            future, function = task
            try:
                future.set_result(function())
            except BaseException as error:
                future.set_exception(error)

    def _rest(self) -> None:
        try:
            if self.idle:
                self.idle()
        except Exception:  # shows itself at the next call, whose answer somebody waits for
            self.idle = None


@contextlib.contextmanager
def closed_on_failure(close: Callable[[], object]) -> Iterator[None]:
    """Give a device back whose opening fails half-way."""
    try:
        yield
    except BaseException:
        close()
        raise


def asked(name: str, what: str, seconds: float, function: Callable[[], T]) -> T:
    """What a function returns in a thread of its own, as ``Worker.call``, for what is asked only once."""
    worker = Worker(name)
    try:
        return worker.call(what, seconds, function)
    finally:
        worker.stop(0, lambda: None)


def line(error: BaseException) -> str:
    """An exception of somebody else's library as one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())[:300]
