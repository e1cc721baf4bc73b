"""Tasks in worker processes of this machine."""

from __future__ import annotations

import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import connection, parent_process
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from .processes import CONTEXT, ONE_THREAD, J, R, start

ATTEMPTS = 2  # of a job whose worker dies: a second loss is the job's fault


class KilledWorkerError(Exception):
    """A worker process died with a job, twice."""


@dataclass(frozen=True)
class Local:
    """Jobs in worker processes of this machine. A worker that dies costs one job, after a second try.

    gpus: to compute on; of several, each worker sees only its own.
    """

    workers: int
    gpus: int = 0

    def map(self, function: Callable[[J], R], jobs: Iterable[J | None]) -> Iterator[tuple[J, R | Exception]]:
        """Results as they come. No more jobs are taken than there are workers."""
        waiting = iter(jobs)
        crew = [_Worker(function, number, self.gpus) for number in range(self.workers)]
        try:
            while True:
                for worker in crew:
                    if worker.job is None and (job := next(waiting, None)) is not None:
                        worker.take(job)
                busy = {worker.channel: worker for worker in crew if worker.job is not None}
                if not busy:
                    return
                for channel in connection.wait(list(busy)):
                    yield from busy[channel].results()  # type: ignore[index]
        finally:
            for worker in crew:
                worker.end()


class _Worker:
    """A process, the parent's end of its channel, the job it has (None: it is idle) and how often it was lost on it."""

    job: Any = None
    lost = 0

    def __init__(self, function: Callable[[J], Any], number: int, gpus: int) -> None:
        own = {"CUDA_VISIBLE_DEVICES": one_gpu(number, gpus)} if gpus > 1 else {}
        self.arguments = (function, {**os.environ, **ONE_THREAD, **own}, Path.cwd())
        self._begin()

    def _begin(self) -> None:
        self.channel, theirs = CONTEXT.Pipe()
        self.process = start(_serve, theirs, *self.arguments)
        theirs.close()

    def take(self, job: Any) -> None:
        """Start a job."""
        self.job = job
        with suppress(BrokenPipeError):  # a dead worker, which ``results`` sees
            self.channel.send(job)

    def results(self) -> Iterator[tuple[Any, Any]]:
        """The job and its result; nothing where the worker died and another one has the job now."""
        try:
            result = self.channel.recv()
        except (EOFError, ConnectionResetError):
            self.lost += 1
            self.end()
            self._begin()
            if self.lost < ATTEMPTS:
                self.take(self.job)
                return
            result = KilledWorkerError(f"its worker process died, {ATTEMPTS} times")
        job, self.job, self.lost = self.job, None, 0
        yield job, result

    def end(self) -> None:
        """End the process, whatever it does."""
        self.process.kill()
        self.process.join()
        self.channel.close()


def _serve(channel: Connection, function: Callable[[Any], Any], environment: dict[str, str], home: Path) -> None:
    """What a worker does: job after job, in the folder ``home``. Ctrl-C is left to the parent process. A worker dies
    with its parent, since a killed run must not go on training in the background."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_die_with_the_parent, daemon=True).start()
    os.chdir(home)
    os.environ.update(environment)  # torch has not looked for a GPU yet
    while True:
        job = channel.recv()
        try:
            result = function(job)
        except Exception as error:
            result = _sendable(error)
        channel.send(result)


def _sendable(error: Exception) -> Exception:
    """An exception that arrives: not all that can be pickled can be read again."""
    try:
        return pickle.loads(pickle.dumps(error)) and error
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")


def one_gpu(number: int, gpus: int) -> str:
    """The GPU of a worker, numbered from 0, of those that this process may see: workers take them in turn."""
    seen = os.environ.get("CUDA_VISIBLE_DEVICES") or ",".join(map(str, range(gpus)))
    return seen.split(",")[number % gpus]


def _die_with_the_parent() -> None:
    parent_process().join()  # type: ignore[union-attr]
    os._exit(1)
