"""What a solution takes of the machine: wall time, and the most memory beyond what was there before it.

Linux keeps the largest resident set that a process ever had (``VmHWM`` in ``/proc/self/status``) and sets it back to
the present one when 5 is written to ``/proc/self/clear_refs`` (proc(5)). Elsewhere memory is not measured.
On a GPU it is the GPU's memory that counts, of torch's tensors, and the clock waits for the work that is under way.
"""

from __future__ import annotations

import ctypes
import gc
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import torch

from ..core.device import CPU

PROCESS = Path("/proc/self")
_KIB_PER_MIB, _BYTES_PER_MIB = 1024, 1024**2


@dataclass(frozen=True)
class Cost:
    """seconds: wall time; memory_mib: peak of the memory above the level before [MiB], None where unknown."""

    seconds: float
    memory_mib: float | None = None


@dataclass(frozen=True)
class Stopwatch:
    """Started by ``start()``, read by ``stop()``: memory (resident [KiB], of a GPU [bytes]; None: not measured) and
    clock at the start."""

    before: int | None
    clock: float
    device: torch.device = CPU

    def stop(self) -> Cost:
        """The effort since the start."""
        if self.device.type == "cuda" and self.before is not None:
            torch.cuda.synchronize(self.device)
            seconds = time.perf_counter() - self.clock
            return Cost(seconds, (torch.cuda.max_memory_allocated(self.device) - self.before) / _BYTES_PER_MIB)
        seconds = time.perf_counter() - self.clock
        peak = None if self.before is None else _status("VmHWM")
        memory = None if peak is None or self.before is None else max(0, peak - self.before) / _KIB_PER_MIB
        return Cost(seconds, memory)


def start(device: torch.device = CPU) -> Stopwatch:
    """Set the peak of memory back and start the clock. device: where the solution is computed.

    What earlier solutions left behind is given back to the system first: memory that an allocator holds in reserve
    would be used again without any growth to be seen.
    """
    _collect()
    _give_back()
    if device.type == "cuda":
        torch.cuda.synchronize(device)
        torch.cuda.reset_peak_memory_stats(device)
        return Stopwatch(torch.cuda.memory_allocated(device), time.perf_counter(), device)
    before = _status("VmRSS") if _set_back() else None
    return Stopwatch(before, time.perf_counter())


def _collect() -> None:
    """Collect garbage; what was there before the first solution, libraries above all, is looked through only once.

    To walk through all of it again takes 0.15 s, longer than some methods need to solve a target.
    """
    gc.collect()
    _freeze()


@cache
def _freeze() -> None:
    gc.freeze()


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
