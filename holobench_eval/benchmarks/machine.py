"""What timings were taken on, and the bandwidth of its memory."""

from __future__ import annotations

import os
import platform
import time
from typing import Any

import torch

from ..core.installed import installed
from ..study.cost import cpu_model
from ..study.provenance import now, revision
from .suite import THREADS

COPIED = 256 * 2**20
"""Bytes, far more than a cache holds."""
BUSY = 0.5
"""Load above which times of short calls are more the scheduler's than the code's."""
PACKAGES = ("torch", "numpy", "opencv-python-headless", "scikit-image", "odak", "torchoptics", "pytest-benchmark")


def load() -> float | None:
    """Programs that computed or waited to, on average over the last minute; None where the system does not tell."""
    try:
        return round(os.getloadavg()[0], 2)
    except (AttributeError, OSError):
        return None


def describe(load_before: float | None) -> dict[str, Any]:
    """What a reader needs to judge the timings of this run. load_before: the ``load`` when it was started."""
    return {
        **revision(),
        "date": now(),
        "cpu": cpu_model(),
        "platform": f"{platform.system()} {platform.release()} {platform.machine()}",
        "python": platform.python_version(),
        "packages": {name: found for name in PACKAGES if (found := installed(name))},
        "threads": THREADS,
        "bandwidth": bandwidth(),
        "load_before": load_before,
    }


def bandwidth() -> float:
    """Bytes a second, read and written, of the best of several copies of a large array."""
    before = torch.get_num_threads()
    torch.set_num_threads(THREADS)
    source = torch.zeros(COPIED, dtype=torch.uint8)
    place = torch.ones_like(source)
    best = float("inf")
    for _ in range(7):
        started = time.perf_counter()
        place.copy_(source)
        best = min(best, time.perf_counter() - started)
    torch.set_num_threads(before)
    return 2 * COPIED / best
