"""Two threads where time is measured; a plain test run keeps its one."""

import sys
from pathlib import Path

import pytest
import torch

from holobench_eval.core.allocator import keep_freed_memory

sys.path.insert(0, str(Path(__file__).parent))


def pytest_addoption(parser):
    parser.addoption("--only", help="Benchmarks whose names hold this text.")


def pytest_collection_modifyitems(config, items):
    text = config.getoption("only", None)
    if text:
        items[:] = [item for item in items if text in item.name]


@pytest.fixture(autouse=True)
def threads(request, tmp_path, monkeypatch):
    keep_freed_memory()  # as a study does
    before = torch.get_num_threads()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))  # timings of a study are measured, not looked up
    torch.set_num_threads(2 if request.config.getoption("benchmark_enable") else before)
    yield
    torch.set_num_threads(before)
