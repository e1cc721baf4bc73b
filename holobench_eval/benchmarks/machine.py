"""What timings were taken on, and the bandwidth of its memory."""

from __future__ import annotations

import os
import platform
from typing import Any

import torch
from torch.utils.benchmark import Timer

from ..core.installed import installed
from ..core.io import now
from ..study.cost import cpu_model
from ..study.provenance import revision
from .suite import THREADS

COPIED = 256 * 2**20  # bytes, far more than a cache holds
BUSY = 0.5  # load above which times of short calls are more the scheduler's than the code's
PACKAGES = (
    *("torch", "numpy", "numba", "rocket-fft", "opencv-python-headless", "scikit-image"),
    *("ducc0", "odak", "torchoptics", "jax", "chromatix"),
)


def load() -> float | None:
    """Programs that computed or waited to, on average over the last minute; None where the system does not tell."""
    try:
        return round(os.getloadavg()[0], 2)
    except (AttributeError, OSError):
        return None


def few_processors() -> None:
    """From now on this process and those it starts run on as many processors as there are to be threads.

    Not every library can be told how many threads to have; all count the processors they may run on.
    """
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:THREADS])


def describe(load_before: float | None, load_after: float | None) -> dict[str, Any]:
    """What a reader needs to judge the timings of this run: the machine, and its ``load`` before and after."""
    return {
        **revision(),
        "date": now(),
        "cpu": cpu_model(),
        "platform": f"{platform.system()} {platform.release()} {platform.machine()}",
        "python": platform.python_version(),
        "packages": {name: version for name in PACKAGES if (version := installed(name))},
        "threads": THREADS,
        "bandwidth": bandwidth(),
        "load_before": load_before,
        "load_after": load_after,
    }


def bandwidth() -> float:
    """Bytes a second, read and written, of the best of several copies of a large array."""
    arrays = {"source": torch.zeros(COPIED, dtype=torch.uint8), "copy": torch.ones(COPIED, dtype=torch.uint8)}
    timer = Timer("copy.copy_(source)", globals=arrays, num_threads=THREADS)
    return 2 * COPIED / min(timer.timeit(1).median for _ in range(7))
