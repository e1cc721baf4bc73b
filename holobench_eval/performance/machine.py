"""What timings were taken on, and the bandwidth of its memory."""

from __future__ import annotations

import platform
import time
from typing import Any

import torch

from ..study.installed import installed
from ..study.provenance import now, revision
from ..study.timings import cpu_model
from .suite import THREADS

COPIED = 256 * 2**20
"""Bytes, far more than a cache holds."""
PACKAGES = ("torch", "numpy", "opencv-python-headless", "scikit-image", "odak", "torchoptics", "pytest-benchmark")


def describe() -> dict[str, Any]:
    """What a reader needs to judge the timings of this run."""
    return {
        **revision(),
        "date": now(),
        "cpu": cpu_model(),
        "platform": f"{platform.system()} {platform.release()} {platform.machine()}",
        "python": platform.python_version(),
        "packages": {name: found for name in PACKAGES if (found := installed(name))},
        "threads": THREADS,
        "bandwidth": bandwidth(),
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
