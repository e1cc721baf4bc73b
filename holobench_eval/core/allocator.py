"""Memory that a step frees and the next one takes again stays with the process."""

from __future__ import annotations

import ctypes
from functools import cache

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3  # mallopt(3) of glibc
LARGEST_KEPT = 32 * 2**20  # bytes of the largest array that glibc keeps; larger ones come from the system each time
KEPT = 2**30  # bytes


@cache
def keep_freed_memory() -> None:
    """Let glibc keep up to 1 GiB of freed memory; without it, every step on a large panel takes its pages anew, which
    takes a fifth of its time. Does nothing where there is another C library."""
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError, TypeError):  # TypeError: no main program to look into, on Windows
        return
    mallopt(M_MMAP_THRESHOLD, LARGEST_KEPT)  # else it would be 128 KiB from the next line on
    mallopt(M_TRIM_THRESHOLD, KEPT)
