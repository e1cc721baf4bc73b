"""Where torch computes, the CPU or a GPU, and with which memory.

Random numbers, registration, scores and files are the CPU's everywhere. Memory that a step frees and the next one takes
again stays with the process, until it is given back.
"""

from __future__ import annotations

import ctypes
import os
import random
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from typing import Any

import cv2
import numpy as np
import torch

from .errors import UserError
from .seeds import seed

CPU = torch.device("cpu")
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, M_MMAP_MAX = -1, -3, -4  # mallopt(3) of glibc
LARGEST_KEPT = 32 * 2**20  # bytes of the largest array that glibc keeps without ``keep_freed_memory``
KEPT = 2**30  # bytes


def find(name: str) -> torch.device:
    """The device ``cpu``, ``cuda`` (the first GPU) or ``cuda:N``; ``auto``: a GPU where torch finds one, else the CPU

    UserError for another name, and for a GPU that is not there.
    """
    known = re.fullmatch(r"auto|cpu|cuda(?::(\d+))?", name)
    if known is None:
        raise UserError(f"unknown device '{name}'; auto, cpu, cuda or cuda:N")
    if not name.startswith("cuda"):
        return torch.device("cuda") if name == "auto" and torch.cuda.is_available() else CPU
    if not torch.cuda.is_available():
        raise UserError(f"--device {name}: torch {torch.__version__} finds no GPU; see 'holoeval doctor'")
    count = torch.cuda.device_count()
    if int(known[1] or 0) >= count:
        raise UserError(f"--device {name}: there {'is 1 GPU' if count == 1 else f'are {count} GPUs'}, from cuda:0 on")
    return torch.device(name)


def gpus(name: str) -> int:
    """GPUs that worker processes on the device ``name`` share out among them; 0 on the CPU. UserError as ``find``."""
    device = find(name)
    if device.type == "cpu":
        return 0
    return torch.cuda.device_count() if device.index is None else 1


def gpu_name(device: torch.device) -> str:
    """The name of a GPU as its maker gives it; empty for the CPU."""
    return torch.cuda.get_device_name(device) if device.type == "cuda" else ""


def moved(value: Any, device: torch.device) -> Any:
    """Tensors and what else can go ``to`` a device, or mappings and lists of them, on it; where nothing has to move,
    the very same value."""
    if hasattr(value, "to"):
        return value.to(device)
    if isinstance(value, Mapping):
        mapping = {key: moved(item, device) for key, item in value.items()}
        return value if all(mapping[key] is item for key, item in value.items()) else mapping
    if isinstance(value, list | tuple):
        listed = [moved(item, device) for item in value]
        return value if all(a is b for a, b in zip(listed, value, strict=True)) else type(value)(listed)
    return value


@contextmanager
def repeatable(threads: int, device: torch.device = CPU) -> Iterator[None]:
    """The same numbers for the same input: threads as asked for, operations without a deterministic form refused.

    On a GPU single precision is meant as such, too: its convolutions would round to ten bits (TF32).
    """
    if device.type == "cuda":
        os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")  # read at the first product of matrices
        torch.backends.cudnn.allow_tf32 = torch.backends.cuda.matmul.allow_tf32 = False
    keep_freed_memory()
    before = torch.get_num_threads(), cv2.getNumThreads(), torch.get_deterministic_debug_mode()
    torch.set_default_dtype(torch.float32)  # a method's file may have changed these three for everybody
    torch.set_default_device(None)
    torch.set_grad_enabled(True)
    value = seed("global random numbers")  # of torch, NumPy and Python
    random.seed(value)
    np.random.seed(value % 2**32)  # noqa: NPY002  what a method's own code may draw from
    torch.default_generator.manual_seed(value)  # torch.manual_seed notes the stack for a GPU not in use, in 2 ms
    if device.type == "cuda":
        torch.cuda.manual_seed_all(value)
    torch.set_num_threads(threads)
    cv2.setNumThreads(threads)  # else it takes all cores, those of other workers too
    torch.set_deterministic_debug_mode("error")  # use_deterministic_algorithms also imports torch's compiler, 1.5 s
    # Filling fresh memory guards against reading it too early; it would be timed with the methods.
    torch.utils.deterministic.fill_uninitialized_memory = False  # type: ignore[attr-defined]
    try:
        yield
    finally:
        torch.set_num_threads(before[0])
        cv2.setNumThreads(before[1])
        torch.set_deterministic_debug_mode(before[2])


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
