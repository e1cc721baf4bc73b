"""Tasks on the workers of a Dask cluster: jobs of a SLURM queue, or a running scheduler."""

from __future__ import annotations

import logging
import os
import platform
import signal
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from ...core.errors import UserError
from ...core.installed import installing
from .processes import ONE_THREAD, J, R

POLL = 0.02  # s between two looks for results
ANSWER = 30.0  # s that a scheduler has to answer
GPU = {"GPU": 1}  # resource that a worker with a GPU declares, and that a job on a GPU requests
# Dask's profiler samples every worker's stack a hundred times a second.
QUIET = {"distributed.worker.profile.enabled": False, "distributed.admin.system-monitor.interval": "5s"}
SETTINGS = {
    **QUIET,
    "distributed.scheduler.allowed-failures": 1,  # a worker lost twice on the same job is the job's fault
    "distributed.logging.distributed": "critical",
}


class _Cluster:
    """What both kinds share. on_gpu: jobs go only to workers that declare a GPU."""

    on_gpu: bool
    _client: Callable[[], AbstractContextManager[Any]]

    def map(self, function: Callable[[J], R], jobs: Iterable[J | None]) -> Iterator[tuple[J, R | Exception]]:
        """Results as they come; as many jobs are taken as there are workers, so the scheduler never holds a study.

        UserError where there is no scheduler, or where it goes away.
        """
        import dask

        home, waiting, running = str(Path.cwd()), iter(jobs), dict[Any, J]()
        resources = GPU if self.on_gpu else None
        with dask.config.set(SETTINGS), self._client() as client:
            while True:
                while len(running) < self._count(client) and (job := next(waiting, None)) is not None:
                    with _answering():
                        future = client.submit(_at_home, home, function, job, pure=False, resources=resources)
                    running[future] = job
                if not running:
                    return
                done = [future for future in running if future.done()]
                with _answering():
                    # Dask cancels what it had; what it is given as it looks for a lost scheduler would wait for ever.
                    if not done and client.status == "closed":
                        raise CancelledError
                    results = [(running.pop(future), future.exception() or future.result()) for future in done]
                yield from results
                if not done:
                    time.sleep(POLL)

    def _usable(self, client: Any) -> dict[str, Any]:
        """The scheduler's present information on the workers that may have jobs, by name."""
        workers = client.scheduler_info(n_workers=-1).get("workers", {})  # none of a scheduler that went away
        return {name: one for name, one in workers.items() if not self.on_gpu or one["resources"].get("GPU", 0) >= 1}

    def _count(self, client: Any) -> int:
        """The number of usable workers, at least 1 so that a job always waits for the first worker."""
        return max(1, len(self._usable(client)))


@dataclass(frozen=True)
class Slurm(_Cluster):
    """Jobs in worker processes that a SLURM queue starts (dask-jobqueue), a worker a SLURM job.

    Queue, memory, cores, walltime and what else the site wants are those of Dask's own configuration
    (``~/.config/dask/jobqueue.yaml``, section ``jobqueue.slurm``). Records, artifacts and data lie in folders that all
    nodes see under the same names. A worker that the queue ends costs the job it had, after a second try elsewhere.
    on_gpu: each worker has a GPU, which the site's configuration asks the queue for.
    """

    workers: int
    on_gpu: bool = False

    @contextmanager
    def _client(self) -> Iterator[Any]:
        on_interrupt = signal.getsignal(signal.SIGINT)
        try:
            from dask_jobqueue.slurm import SLURMCluster
        except ImportError:
            raise UserError(f"the executor slurm needs dask-jobqueue: {installing(extra='cluster')}") from None
        finally:
            signal.signal(signal.SIGINT, on_interrupt)  # which importing it sets to an exit with code 0
        import dask
        from distributed import Client

        try:
            declared = None  # the site's alone
            if self.on_gpu:
                declared = [*dask.config.get("jobqueue.slurm.worker-extra-args"), "--resources", "GPU=1"]
            cluster = SLURMCluster(processes=1, job_script_prologue=_exports(), worker_extra_args=declared)
            cluster.scale(jobs=self.workers)  # type: ignore[no-untyped-call]
        except (ValueError, TypeError) as error:  # a configuration that says too little, or what cannot be
            raise UserError(f"the SLURM cluster: {error}; see jobqueue.slurm in Dask's configuration") from error
        with cluster, Client(cluster) as client:  # type: ignore[no-untyped-call]
            yield client


@dataclass(frozen=True)
class Address(_Cluster):
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
            return self._count(client)

    @contextmanager
    def _client(self) -> Iterator[Any]:
        from distributed import Client

        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # not the traceback of a lost scheduler
        try:
            client = Client(self.address, timeout=ANSWER)  # type: ignore[no-untyped-call]
        except (OSError, ValueError, TimeoutError) as error:
            raise UserError(f"no Dask scheduler answers at '{self.address}' (like tcp://host:8786)") from error
        with client:
            workers = self._usable(client)
            several = [name for name, worker in workers.items() if worker["nthreads"] != 1]
            if several:
                raise UserError(f"worker {several[0]} has several threads; start workers with --nthreads 1")
            if not workers and self.on_gpu:
                start = f'dask worker {self.address} --nthreads 1 --resources "GPU=1"'
                raise UserError(f"no worker at '{self.address}' declares a GPU; start one with: {start}")
            if not workers:
                raise UserError(f"the Dask scheduler at '{self.address}' has no workers")
            yield client


def _at_home(home: str, function: Callable[[J], R], job: J) -> R:
    """The result of a job, whose relative paths start in the folder ``home``, wherever its worker was started."""
    try:
        os.chdir(home)
    except OSError as error:
        raise UserError(f"the worker on {platform.node()} does not see the folder {home}: {error.strerror}") from error
    return function(job)


@contextmanager
def _answering() -> Iterator[None]:
    """What is asked of a Dask scheduler. UserError: it went away."""
    from distributed.client import ClosedClientError

    try:
        yield
    except (CancelledError, ClosedClientError, OSError) as error:
        kept = "what is finished is kept, and the same command computes the rest"
        raise UserError(f"the Dask scheduler went away; {kept}") from error


def _exports() -> list[str]:
    """Lines of a job script that give a worker one thread, and keep Dask quiet."""
    names = {f"DASK_{key.upper().replace('-', '_').replace('.', '__')}": value for key, value in QUIET.items()}
    return [f"export {name}={value}" for name, value in {**ONE_THREAD, **names}.items()]
