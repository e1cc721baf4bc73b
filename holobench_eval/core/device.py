"""Where torch computes, the CPU or a GPU. Random numbers, registration, scores and files are the CPU's everywhere."""

from __future__ import annotations

import os
import random
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import cv2
import numpy as np
import torch

from .allocator import keep_freed_memory
from .errors import UserError
from .seeds import seed

CPU = torch.device("cpu")


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
    _seed_globally(seed("global random numbers"), device)
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


def _seed_globally(value: int, device: torch.device) -> None:
    """The random numbers of torch, NumPy and Python.

    ``torch.manual_seed`` would also note the whole stack for a GPU that is not in use, each time, which takes 2 ms.
    """
    random.seed(value)
    np.random.seed(value % 2**32)  # noqa: NPY002  what a method's own code may draw from
    torch.default_generator.manual_seed(value)
    if device.type == "cuda":
        torch.cuda.manual_seed_all(value)
