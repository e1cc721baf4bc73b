"""Where torch computes, the CPU or a GPU. Random numbers, registration, scores and files are the CPU's everywhere."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor

from .errors import UserError

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
    """Tensors, or mappings and lists of them, on a device; where nothing has to move, the very same value."""
    if isinstance(value, Tensor):
        return value.to(device)
    if isinstance(value, Mapping):
        mapping = {key: moved(item, device) for key, item in value.items()}
        return value if all(mapping[key] is item for key, item in value.items()) else mapping
    if isinstance(value, list | tuple):
        listed = [moved(item, device) for item in value]
        return value if all(a is b for a, b in zip(listed, value, strict=True)) else type(value)(listed)
    return value
