"""Memory that a step frees and the next one takes again stays with the process, until it is given back."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, M_MMAP_MAX = -1, -3, -4  # mallopt(3) of glibc
LARGEST_KEPT = 32 * 2**20  # bytes of the largest array that glibc keeps without ``keep_freed_memory``
KEPT = 2**30  # bytes


@cache
def keep_freed_memory() -> None:
    """Let glibc keep up to 1 GiB of freed memory, of large arrays too; does nothing where there is another C library.

    Without it, arrays of more than 32 MiB come from the system each time, page by page: at 1080x1920 in three colours
    HaarPSI took 1.8 times as long, the feature distance 1.7 times, a capture at three sub-samples 1.1 times. The price
    is memory, since arrays of other sizes leave gaps between those in use: the peak of the process rose by 38, 58 and
    19 %.
    """
    if mallopt := _of_libc("mallopt"):
        mallopt(M_MMAP_MAX, 0)
        mallopt(M_TRIM_THRESHOLD, KEPT)


@cache
def return_large_arrays() -> None:
    """Let glibc return every array above 1 MiB to the system when it is freed; does nothing where there is another C
    library.

    Without it, freed arrays of a few MiB leave gaps, into which those of the next step do not fit: HaarPSI of 2160x3840
    in three colours took 640 MiB, and takes 420.
    """
    if mallopt := _of_libc("mallopt"):
        mallopt(M_MMAP_THRESHOLD, 2**20)


def give_back_freed_memory() -> None:
    """Return freed memory to the system, the gaps between arrays in use as well, where the C library can (glibc)."""
    if trim := _of_libc("malloc_trim"):
        trim(0)


def _of_libc(name: str) -> Callable[..., int] | None:
    try:
        function: Callable[..., int] = getattr(ctypes.CDLL(None), name)
    except (OSError, AttributeError, TypeError):  # TypeError: no main program to look into, on Windows
        return None
    return function
