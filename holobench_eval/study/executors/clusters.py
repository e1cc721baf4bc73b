"""Tasks on the workers of a Dask cluster: jobs of a SLURM queue, or a running scheduler."""

from __future__ import annotations

import logging
import os
import platform
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

from ...core.errors import UserError
from ...core.installed import installing
from .processes import ONE_THREAD

J = TypeVar("J")
R = TypeVar("R")

WORKER_ENVIRONMENT = {
    **ONE_THREAD,
    # Not its profiler, which samples every worker's stack a hundred times a second.
    "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False",
    "DASK_DISTRIBUTED__ADMIN__SYSTEM_MONITOR__INTERVAL": "5s",
}
POLL = 0.02  # s between two looks for results
ANSWER = 30.0  # s that a scheduler has to answer
GPU = {"GPU": 1}  # resource that a worker with a GPU declares, and that a job on a GPU requests
SETTINGS = {
    # A worker lost twice on the same job is the job's fault.
    "distributed.scheduler.allowed-failures": 1,
    "distributed.logging.distributed": "critical",
    "distributed.worker.profile.enabled": False,
    "distributed.admin.system-monitor.interval": "5s",
}


@dataclass(frozen=True)
class Slurm:
    """Jobs in worker processes that a SLURM queue starts (dask-jobqueue), a worker a SLURM job.

    Queue, memory, cores, walltime and what else the site wants are those of Dask's own configuration
    (``~/.config/dask/jobqueue.yaml``, section ``jobqueue.slurm``). Records, artifacts and data lie in folders that all
    nodes see under the same names. A worker that the queue ends costs the job it had, after a second try elsewhere.
    on_gpu: each worker has a GPU, which the site's configuration asks the queue for.
    """

    workers: int
    on_gpu: bool = False

    def map(self, function: Callable[[J], R], jobs: Iterable[J | None]) -> Iterator[tuple[J, R | Exception]]:
        """Results as they come, from the first worker that the queue starts on. UserError without dask-jobqueue."""
        try:
            from dask_jobqueue.slurm import SLURMCluster
        except ImportError:
            raise UserError(f"the executor slurm needs dask-jobqueue: {installing(extra='cluster')}") from None
        from distributed import Client

        with _settings():
            try:
                declared = _declared() if self.on_gpu else None  # None: the site's alone
                cluster = SLURMCluster(processes=1, job_script_prologue=_exports(), worker_extra_args=declared)
                cluster.scale(jobs=self.workers)  # type: ignore[no-untyped-call]
            except (ValueError, TypeError) as error:  # a configuration that says too little, or what cannot be
                raise UserError(f"the SLURM cluster: {error}; see jobqueue.slurm in Dask's configuration") from error
            with cluster, Client(cluster) as client:  # type: ignore[no-untyped-call]
                yield from _results(client, lambda: _there(client, self.on_gpu), function, jobs, self.on_gpu)


@dataclass(frozen=True)
class Address:
    """Jobs on the workers of a Dask scheduler that runs already, which may come and go.

    Each worker has one thread (``dask worker --nthreads 1``): torch's settings are those of a process. Folders are as
    for ``Slurm``. address: such as ``tcp://host:8786``; on_gpu: jobs go only to workers that declare a GPU.
    """

    address: str
    on_gpu: bool = False

    @cached_property
    def workers(self) -> int:
        """Workers that are there now. UserError: the scheduler does not answer, or has none that can be used."""
        with self._client() as client:
            return _there(client, self.on_gpu)

    def map(self, function: Callable[[J], R], jobs: Iterable[J | None]) -> Iterator[tuple[J, R | Exception]]:
        """Results as they come."""
        with _settings(), self._client() as client:
            yield from _results(client, lambda: _there(client, self.on_gpu), function, jobs, self.on_gpu)

    @contextmanager
    def _client(self) -> Iterator[Any]:
        from distributed import Client

        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # not the traceback of a lost scheduler
        try:
            client = Client(self.address, timeout=ANSWER)  # type: ignore[no-untyped-call]
        except (OSError, ValueError, TimeoutError) as error:
            raise UserError(f"no Dask scheduler answers at '{self.address}' (like tcp://host:8786)") from error
        with client:
            workers = _usable(client, self.on_gpu)
            several = [name for name, worker in workers.items() if worker["nthreads"] != 1]
            if several:
                raise UserError(f"worker {several[0]} has several threads; start workers with --nthreads 1")
            if not workers and self.on_gpu:
                start = f'dask worker {self.address} --nthreads 1 --resources "GPU=1"'
                raise UserError(f"no worker at '{self.address}' declares a GPU; start one with: {start}")
            if not workers:
                raise UserError(f"the Dask scheduler at '{self.address}' has no workers")
            yield client


def _usable(client: Any, on_gpu: bool) -> dict[str, Any]:
    """The scheduler's present information on its workers, by name; on_gpu: only of those that declare a GPU."""
    workers = client.scheduler_info(n_workers=-1).get("workers", {})  # none of a scheduler that went away
    return {
        name: worker
        for name, worker in workers.items()
        if not on_gpu or worker["resources"].get("GPU", 0) >= GPU["GPU"]
    }


def _there(client: Any, on_gpu: bool) -> int:
    """The number of usable workers, at least 1 so that a job always waits for the first worker."""
    return max(1, len(_usable(client, on_gpu)))


@contextmanager
def _settings() -> Iterator[None]:
    import dask

    with dask.config.set(SETTINGS):
        yield


def _at_home(home: str, function: Callable[[J], R], job: J) -> R:
    """The result of a job, whose relative paths start in the folder ``home``, wherever its worker was started."""
    try:
        os.chdir(home)
    except OSError as error:
        raise UserError(f"the worker on {platform.node()} does not see the folder {home}: {error.strerror}") from error
    return function(job)


def _results(
    client: Any, workers: Callable[[], int], function: Callable[[J], R], jobs: Iterable[J | None], on_gpu: bool
) -> Iterator[tuple[J, R | Exception]]:
    """Results as they come; as many jobs are taken as there are workers, so the scheduler never holds a whole study."""
    from distributed import as_completed

    home, waiting = str(Path.cwd()), iter(jobs)
    running: dict[Any, J] = {}
    completed = as_completed()  # type: ignore[no-untyped-call]

    def fill() -> None:
        while len(running) < workers() and (job := next(waiting, None)) is not None:
            with _answering():
                future = client.submit(_at_home, home, function, job, pure=False, resources=GPU if on_gpu else None)
                running[future] = job
                completed.add(future)  # type: ignore[no-untyped-call]

    fill()
    while running:
        with _answering():
            done = completed.next_batch(block=False)  # type: ignore[no-untyped-call]
            # Dask cancels what it had; what it is given while it looks for a lost scheduler would wait for ever.
            if not done and client.status == "closed":
                raise CancelledError
        if not done:
            time.sleep(POLL)
        for future in done:
            job = running.pop(future)
            with _answering():
                error = future.exception()
                result = error if error is not None else future.result()
            yield job, result
            fill()


@contextmanager
def _answering() -> Iterator[None]:
    """What is asked of a Dask scheduler. UserError: it went away."""
    from distributed.client import ClosedClientError

    try:
        yield
    except (CancelledError, ClosedClientError, OSError) as error:
        raise UserError(
            "the Dask scheduler went away; what is finished is kept, and the same command computes the rest"
        ) from error


def _exports() -> list[str]:
    """Lines of a job script that give a worker one thread."""
    return [f"export {name}={value}" for name, value in WORKER_ENVIRONMENT.items()]


def _declared() -> list[str]:
    """Arguments of a worker that has a GPU, the site's own before them."""
    import dask

    return [*dask.config.get("jobqueue.slurm.worker-extra-args"), "--resources", "GPU=1"]
