"""Where tasks are computed: in this process, in several of this machine, or on a cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from ...core.errors import UserError, suggest
from .clusters import Address, Slurm
from .local import Local
from .processes import J, R, prepare


@dataclass(frozen=True)
class Serial:
    """One job after the other, in this process."""

    workers: int = 1

    def map(self, function: Callable[[J], R], jobs: Iterable[J | None]) -> Iterator[tuple[J, R | Exception]]:
        """Results in the order of the jobs."""
        for job in jobs:
            if job is not None:
                yield job, function(job)


Executor = Serial | Local | Slurm | Address
"""Runs a function over jobs, ``workers`` of them side by side.

``map`` takes a job from the iterable when it starts it, and yields (job, result) as results come, in any order; a job
whose worker was lost gives the exception instead of a result. None instead of a job: the next job waits for a running
one; ask the iterable again after the next result.
"""
NAMES = ("auto", "serial", "local", "slurm", "address")
ELSEWHERE = ("slurm", "address")  # their workers are on other machines and know their own GPUs


def executor(name: str, workers: int | None, small: bool = True, address: str | None = None, gpus: int = 0) -> Executor:
    """The executor of a name; ``workers`` defaults to the number of GPUs to compute on, or of cores without a GPU.

    "auto" is local if the study's panel is small and several workers are available, else serial: a small panel does
    not keep several threads busy, a large panel fills the memory. With GPUs, "auto" is local
    if there are several. address: of a running Dask scheduler; gpus: to compute on; for workers elsewhere, 1 if each
    has one.
    """
    if name not in NAMES:
        raise UserError(f"unknown executor '{name}'; {suggest(name, NAMES)}")
    if workers is not None and workers < 1:
        raise UserError(f"--workers should be at least 1, got {workers}")
    if (name == "address") != (address is not None):
        raise UserError("--executor address and --address tcp://HOST:PORT belong together")
    if name in ("serial", "address") and workers not in (None, 1):
        raise UserError(f"--workers {workers} needs --executor local or slurm; {name} has its own")
    if address is not None:
        return Address(address, on_gpu=gpus > 0)
    if name == "slurm":
        if workers is None:
            raise UserError("--executor slurm needs --workers, how many SLURM jobs to start")
        return Slurm(workers, on_gpu=gpus > 0)
    count = workers or gpus or _cores()
    if name == "serial" or (name == "auto" and (count == 1 or not (small or workers or gpus))):
        return Serial()
    return Local(count, gpus)


def begin(name: str, workers: int | None, small: bool) -> None:
    """Start what an executor needs whose study is still being read; arguments as of ``executor``. GPUs are not looked
    for: their workers are then started later."""
    if workers != 1 and (name == "local" or (name == "auto" and _cores() > 1 and (small or workers is not None))):
        prepare()


def _cores() -> int:
    """Cores that this process may use; all cores on macOS, which does not report the limit."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
