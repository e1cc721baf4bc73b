"""Where tasks are computed: in this process, or in several processes of this machine."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from ..errors import UserError, suggest

J = TypeVar("J")
R = TypeVar("R")

WORKER_ENVIRONMENT = {"OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
"""Dask's own, without its MALLOC_TRIM_THRESHOLD_: that gives every freed tensor back to the system, and getting the
next one from there doubles the time of a step."""


class Executor(Protocol):
    """Runs a function over jobs.

    ``map`` takes a job from the iterable when it starts it, and yields (job, result) as results come, in any
    order; a job whose worker was lost gives the exception instead of a result. None in the place of a job: the next
    waits for one that is at work, ask again when a result has been taken.
    """

    @property
    def workers(self) -> int:
        """Jobs computed side by side."""
        ...

    def map(self, function: Callable[[J], R], jobs: Iterable[J | None]) -> Iterator[tuple[J, R | Exception]]:
        """Results of ``function`` over ``jobs``."""
        ...


@dataclass(frozen=True)
class Serial:
    """One job after the other, in this process."""

    workers: int = 1

    def map(self, function: Callable[[J], R], jobs: Iterable[J | None]) -> Iterator[tuple[J, R | Exception]]:
        """Results in the order of the jobs."""
        for job in jobs:
            if job is not None:
                yield job, function(job)


@dataclass(frozen=True)
class Local:
    """Jobs in worker processes of this machine (Dask). A worker that dies costs one job, after a second try."""

    workers: int

    def map(self, function: Callable[[J], R], jobs: Iterable[J | None]) -> Iterator[tuple[J, R | Exception]]:
        """Results as they come. No more jobs are taken than there are workers."""
        import dask
        from distributed import Client, LocalCluster, as_completed

        # A worker lost twice on the same job is the job's fault; and no worker may die because others fill the memory.
        settings = {
            "distributed.scheduler.allowed-failures": 1,
            "distributed.logging.distributed": "critical",
            "distributed.nanny.pre-spawn-environ": WORKER_ENVIRONMENT,
        }
        with (
            dask.config.set(settings),
            LocalCluster(  # type: ignore[no-untyped-call]
                n_workers=self.workers,
                threads_per_worker=1,
                processes=True,
                memory_limit=0,
                dashboard_address=None,
                silence_logs=50,
            ) as cluster,
            Client(cluster) as client,  # type: ignore[no-untyped-call]
        ):
            client.register_plugin(_bound_to_the_parent())
            waiting = iter(jobs)
            running: dict[Any, J] = {}
            completed = as_completed()  # type: ignore[no-untyped-call]

            def fill() -> None:
                while len(running) < self.workers and (job := next(waiting, None)) is not None:
                    future = client.submit(function, job, pure=False)
                    running[future] = job
                    completed.add(future)  # type: ignore[no-untyped-call]

            fill()
            for future in completed:
                job = running.pop(future)
                error = future.exception()
                yield job, error if error is not None else future.result()
                fill()


def _bound_to_the_parent() -> Any:
    """A plugin by which every worker, a restarted one too, leaves Ctrl-C to the process that started it and dies with
    it: a killed run must not go on training in the background."""
    from distributed import WorkerPlugin

    class BoundToParent(WorkerPlugin):
        def setup(self, worker: object) -> None:
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            threading.Thread(target=_die_with, args=(os.getppid(),), daemon=True).start()

    return BoundToParent()


def _die_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(0.5)
    os._exit(1)


NAMES = ("auto", "serial", "local")


def executor(name: str, workers: int | None, small: bool = True) -> Executor:
    """The executor of a name; ``workers`` defaults to the number of processors.

    "auto" is local where the study's panel is small and there is more than one worker to have, else serial: a small
    panel does not keep several threads busy, a large one fills the memory.
    """
    if name not in NAMES:
        raise UserError(f"unknown executor '{name}'; {suggest(name, NAMES)}")
    if workers is not None and workers < 1:
        raise UserError(f"--workers should be at least 1, got {workers}")
    if name == "serial":
        if workers not in (None, 1):
            raise UserError(f"--workers {workers} needs --executor local; the serial executor has one")
        return Serial()
    if name == "auto" and ((workers or _cores()) == 1 or (not small and workers is None)):
        return Serial()
    return Local(workers or _cores())


def _cores() -> int:
    """Cores that this process may use; macOS does not tell and gives all of them."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
