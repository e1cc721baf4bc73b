"""What a process keeps and holds of memory, where glibc and Linux tell."""

import ctypes
from contextlib import suppress
from pathlib import Path

PROCESS = Path("/proc/self")


def as_a_study():
    """Keep freed memory as a study of this package does."""
    with suppress(ModuleNotFoundError):  # of a version that is older than this
        from holobench_eval.core.allocator import keep_freed_memory

        keep_freed_memory()


def give_back():
    """Freed memory to the system."""
    try:
        ctypes.CDLL(None).malloc_trim(0)
    except (OSError, AttributeError, TypeError):  # another C library; TypeError on Windows
        return


def resident():
    """Bytes that the process holds; None where the system does not tell."""
    return _status("VmRSS")


def peak(call):
    """The most bytes that the process holds during a call; None where the system does not tell."""
    try:
        (PROCESS / "clear_refs").write_text("5")  # sets the largest set so far to the present one, proc(5)
    except OSError:
        return None
    call()
    return _status("VmHWM")


def _status(name):
    try:
        lines = (PROCESS / "status").read_text().splitlines()
    except OSError:
        return None
    return next((1024 * int(line.split()[1]) for line in lines if line.startswith(f"{name}:")), None)
