"""The cost of a solution: wall time, processor time, and the peak of memory above the level before it.

These are the only numbers of a table that differ from run to run: a study reports what it measured itself. The last
time that a method took is also kept in ``$XDG_CACHE_HOME`` (or ``~/.cache``) ``/holobench_eval/timings/``, from which
the time is estimated that a study takes.

Linux keeps the largest resident set that a process ever had (``VmHWM`` in ``/proc/self/status``) and sets it back to
the present one when 5 is written to ``/proc/self/clear_refs`` (proc(5)). Elsewhere memory is not measured.
A method in a process of its own could do that, too, and could work before its clock or leave work to others. So its
peak is looked up every ``EACH`` seconds, what it took from its fork until it was ready counts as wall time, as does
what it did since its last call, and processor time and memory are those of all processes that it has started.
On a GPU the memory is that of torch's tensors on it, and the clock waits until the queued work is done.
"""

from __future__ import annotations

import gc
import math
import os
import platform
import threading
import time
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import torch

from ..core.device import CPU, give_back_freed_memory
from ..core.errors import StorageError
from ..core.hashing import digest
from ..core.installed import __version__
from ..core.io import write_atomically
from .definition import Study
from .executors.processes import cpu_of, descendants
from .plan import Plan, Task

PROCESS = Path("/proc/self")
_KIB_PER_MIB, _BYTES_PER_MIB = 1024, 1024**2
KIND = ("code", "params", "optics", "display", "captures")  # entries of a phase that tell how long it takes
APART = 10.0  # s between two times that are kept
EACH = 0.05  # s between two looks at the memory of a process


@dataclass(frozen=True)
class Cost:
    """seconds: wall time; memory_mib: peak of the memory above the level before [MiB]; cpu_s: time of all processors
    [s]; None where unknown."""

    seconds: float
    memory_mib: float | None = None
    cpu_s: float | None = None

    def after(self, before: Iterable[Cost]) -> Cost:
        """The same with what was begun with and is from before: all of its time, and the peak, if each is known."""
        costs = [self, *before]
        memory, cpu = [each.memory_mib for each in costs], [each.cpu_s for each in costs]
        return Cost(
            sum(each.seconds for each in costs),
            None if None in memory else max(filter(None, memory), default=0.0),
            None if None in cpu else sum(filter(None, cpu)),
        )


class Stopwatch:
    """Resets the peak of memory and starts the clock; read by ``stop()``.

    The allocator of this process is trimmed first, so that reused memory shows as growth (but for the end of its memory
    in a process whose program break could not be raised: glibc keeps that).

    device: where the solution is computed; process: the number of the one that computes it, None for this one. What
    another process takes on a GPU is not measured. before: memory at the start, resident [KiB] or of a GPU [bytes]
    (None: not measured); late: seconds for which it has worked before, see ``isolation.Opened``.
    """

    def __init__(self, device: torch.device = CPU, process: int | None = None, late: float = 0.0) -> None:
        self.device, self.process, self.late = device, process, late
        self.before: int | None = None
        self.peak: _Peak | None = None
        if process is None:
            gc.collect()
            _freeze()
            give_back_freed_memory()
        self.on_gpu = device.type == "cuda" and process is None
        if self.on_gpu:
            torch.cuda.synchronize(device)
            torch.cuda.reset_peak_memory_stats(device)
            self.before = torch.cuda.memory_allocated(device)
        elif device.type != "cuda" and _set_back(process):
            self.before = _status("VmRSS", process)
        if process is not None and self.before is not None:
            self.peak = _Peak(process)
        self.clock, self.cpu = time.perf_counter(), _cpu(process)

    def stop(self) -> Cost:
        """The cost since the start; of another process since its fork."""
        if self.on_gpu:
            torch.cuda.synchronize(self.device)
        seconds, cpu, memory = self.late + time.perf_counter() - self.clock, _cpu(self.process), None
        if self.on_gpu and self.before is not None:
            memory = (torch.cuda.max_memory_allocated(self.device) - self.before) / _BYTES_PER_MIB
        elif self.before is not None:
            peak = self.peak.end() if self.peak else _status("VmHWM", None)
            memory = None if peak is None else max(0, peak - self.before) / _KIB_PER_MIB
        if self.cpu is None or cpu is None:
            return Cost(seconds, memory)
        if self.process is None:
            return Cost(seconds, memory, cpu - self.cpu)
        before = self.cpu if self.device.type == "cpu" else 0.0  # to open a GPU takes longer than many solutions
        return Cost(seconds + max(0.0, before - self.late), memory, cpu)


class _Peak(threading.Thread):
    """The peak of memory [KiB] of another process and of those that it has started, looked up again and again."""

    def __init__(self, process: int) -> None:
        super().__init__(daemon=True)
        self.process, self.kib, self.ended = process, 0, threading.Event()
        self.start()

    def run(self) -> None:
        """Look until the end, or until the process has gone."""
        while self._look() and not self.ended.wait(EACH):
            pass

    def end(self) -> int:
        """The peak up to now."""
        self.ended.set()
        self.join()
        self._look()
        return self.kib

    def _look(self) -> bool:
        own = _status("VmHWM", self.process)
        others = [_status("Pss", number, "smaps_rollup") for number in _started(self.process)]
        self.kib = max(self.kib, (own or 0) + sum(filter(None, others)))
        return own is not None


def _cpu(process: int | None) -> float | None:
    """Processor time [s] of a process and those that it has started, None where unknown. process: None for this one,
    of whose processes only those count that have ended."""
    if process is None:
        return time.process_time() + sum(os.times()[2:4])
    try:
        return sum(map(cpu_of, (process, *_started(process))))
    except (OSError, ValueError):
        return None


def _started(process: int) -> list[int]:
    """Numbers of the processes that a method's process has started; the one it was forked from adopts their orphans."""
    return [number for number in descendants(_status("PPid", process) or process) if number != process]


@cache
def _freeze() -> None:
    """Freeze the objects that exist before the first solution, most of them of libraries.

    Scanning them again would take 0.15 s, longer than some methods need to solve a target.
    """
    gc.freeze()


def _set_back(process: int | None) -> bool:
    try:
        (_process(process) / "clear_refs").write_text("5")
    except OSError:
        return False
    return True


def _process(number: int | None) -> Path:
    return PROCESS if number is None else PROCESS.with_name(str(number))


def _status(name: str, process: int | None, file: str = "status") -> int | None:
    """A field of ``/proc/self/status`` [KiB], or of another process or file."""
    try:
        text = (_process(process) / file).read_text()
    except OSError:
        return None
    return next((int(line.split()[1]) for line in text.splitlines() if line.startswith(f"{name}:")), None)


def folder() -> Path:
    """Where timings are kept."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "holobench_eval/timings")


@cache
def cpu_model() -> str:
    """The processor's name, or its architecture where the system gives no name."""
    with suppress(OSError, StopIteration):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        return next(line for line in lines if line.startswith("model name")).partition(":")[2].strip()
    return platform.processor() or platform.machine()


def timed(study: Study, plan: Plan) -> frozenset[str]:
    """Cells of the solutions that a study with ``timing: alone`` times without concurrent workers; else none.

    Each row of the tables is timed on the last target of the first repeat: a method's first solution also loads
    libraries.
    """
    if study.timing == "shared":
        return frozenset()
    solved = [task for task in plan.tasks if not task.is_floor]
    last = {(task.label, cell.condition): task for task in solved for cell in task.cells if cell.repeat == 0}
    return frozenset(cell.id for task in last.values() for cell in task.cells)


def key(task: Task, threads: int, workers: int, gpu: str = "", apart: bool = False) -> str:
    """The name under which the time of a task is kept, which tasks for other targets share.

    It holds the method, its parameters and optics, the display if the method sees it, and the machine. gpu: its name,
    empty for none; apart: in a process of its own.
    """
    phase = task.cells[0].phase
    kind = {name: phase.get(name) for name in KIND} | {"planes": len(phase.get("planes", ()))}
    machine = [cpu_model(), platform.machine(), threads, workers, *filter(None, (gpu, "apart" * apart))]
    return digest([kind, task.cells[0].measure, machine, torch.__version__, __version__])


def recorded(name: str) -> float | None:
    """The seconds that were kept last under a name, None if there are none."""
    with suppress(OSError, ValueError):
        if 0 <= (seconds := float((folder() / name).read_text(encoding="utf-8"))) < math.inf:
            return seconds
    return None


def keep(name: str, seconds: float) -> None:
    """Keep a time for estimates; at most one a name in ``APART`` seconds, since a study may have thousands."""
    now, file = time.monotonic(), folder() / name
    if now - _kept.get(file, -math.inf) >= APART:
        _kept[file] = now
        with suppress(StorageError):  # a cache, which a run can do without
            write_atomically(file, repr(seconds).encode(), lasting=False)


_kept: dict[Path, float] = {}  # when [s] this process wrote each file last
