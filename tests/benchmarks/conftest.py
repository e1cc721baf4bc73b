"""The benchmarks import each other as they do in ``worker``; what a study keeps goes into a folder of the test."""

import sys
from pathlib import Path

import pytest
import torch

from holobench_eval.core.allocator import keep_freed_memory

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(autouse=True)
def as_in_a_study(request, tmp_path, monkeypatch):
    """Two threads where time is measured; a plain test run keeps its one."""
    keep_freed_memory()
    before = torch.get_num_threads()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    torch.set_num_threads(2 if request.config.getoption("benchmark_enable") else before)
    yield
    torch.set_num_threads(before)
