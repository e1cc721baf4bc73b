"""Freed memory stays with a process that asks for it."""

import platform
import subprocess
import sys

import pytest

STEPS = """
import ctypes, resource
import numpy as np
from holobench_eval.core.device import keep_freed_memory

def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    np.ones(2**26, np.uint8)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

keep_freed_memory()
faults()
print(faults())
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another C library")
def test_an_array_that_is_freed_and_taken_again_costs_no_page_fault():
    """64 MiB: beyond 32 MiB, arrays come from the system each time unless glibc is told otherwise."""
    found = subprocess.run([sys.executable, "-c", STEPS], capture_output=True, text=True, check=True)
    assert int(found.stdout) < 100
