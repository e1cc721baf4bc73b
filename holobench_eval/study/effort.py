"""What a solution takes of the machine: wall time, and the most memory beyond what was there before it.

Linux keeps the largest resident set that a process ever had (``VmHWM`` in ``/proc/self/status``) and sets it back to
the present one when 5 is written to ``/proc/self/clear_refs`` (proc(5)). Elsewhere memory is not measured.
"""

from __future__ import annotations

import ctypes
import gc
import time
from dataclasses import dataclass
from pathlib import Path

PROCESS = Path("/proc/self")
_KIB_PER_MIB = 1024


@dataclass(frozen=True)
class Effort:
    """seconds: wall time; memory_mib: peak of the resident memory above the level before [MiB], None where unknown."""

    seconds: float
    memory_mib: float | None = None


@dataclass(frozen=True)
class Stopwatch:
    """Started by ``start()``, read by ``stop()``: resident memory [KiB] (None: not measured) and clock at the start."""

    before: int | None
    clock: float

    def stop(self) -> Effort:
        """The effort since the start."""
        seconds = time.perf_counter() - self.clock
        peak = None if self.before is None else _status("VmHWM")
        memory = None if peak is None or self.before is None else max(0, peak - self.before) / _KIB_PER_MIB
        return Effort(seconds, memory)


def start() -> Stopwatch:
    """Set the peak of memory back and start the clock.

    What earlier solutions left behind is given back to the system first: memory that an allocator holds in reserve
    would be used again without any growth to be seen.
    """
    gc.collect()
    _give_back()
    before = _status("VmRSS") if _set_back() else None
    return Stopwatch(before, time.perf_counter())


def _set_back() -> bool:
    try:
        (PROCESS / "clear_refs").write_text("5")
    except OSError:
        return False
    return True


def _give_back() -> None:
    """Return freed memory to the system, where the C library can (glibc)."""
    try:
        trim = ctypes.CDLL(None).malloc_trim
    except (OSError, AttributeError, TypeError):  # TypeError: no main program to look into, on Windows
        return
    trim(0)


def _status(name: str) -> int | None:
    """A field of ``/proc/self/status`` [KiB]."""
    try:
        text = (PROCESS / "status").read_text()
    except OSError:
        return None
    return next((int(line.split()[1]) for line in text.splitlines() if line.startswith(f"{name}:")), None)
