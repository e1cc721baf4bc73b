"""The benchmarks import each other; what a study keeps goes into a folder of the test."""

import os
import sys
from pathlib import Path

import pytest
import torch

from holobench_eval.core.device import keep_freed_memory
from holobench_eval.core.installed import installed

sys.path.insert(0, str(Path(__file__).parent))
PACKAGES = ("torch", "numpy", "numba", "scikit-image", "ducc0", "odak", "torchoptics", "jax", "chromatix")


@pytest.fixture(scope="session", autouse=True)
def two_processors(request):
    """Where time is measured. Not every library can be told its number of threads; all count the processors."""
    keep_freed_memory()  # for all versions alike: no call waits for new pages
    if request.config.getoption("benchmark_enable") and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:2])


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    threads = torch.get_num_threads()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    yield
    torch.set_num_threads(threads)


def pytest_benchmark_update_machine_info(machine_info):
    """Versions of what is timed, and no name of the machine."""
    machine_info.pop("node", None)
    machine_info["packages"] = {name: version for name in PACKAGES if (version := installed(name))}
