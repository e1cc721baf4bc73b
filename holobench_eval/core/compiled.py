"""Functions that Numba compiles, once on a machine, where it is installed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import torch
from torch import Tensor

try:
    from numba import config, njit
except ImportError:
    njit = None

Function = TypeVar("Function", bound=Callable[..., Any])

AVAILABLE = njit is not None and not config.DISABLE_JIT
_compile: Any = njit
_OPTIONS = {"nogil": True, "error_model": "numpy"}
_ROUNDING = {"contract"}  # a product and a sum are rounded once


def compiled(function: Function) -> Function:
    """A function compiled by Numba, without Numba's own threads: ``optics.blocks.in_blocks`` shares the work.

    Where Numba is not installed it is the function itself, far too slow for images: ask ``usable`` first. Numba
    compiles again when the file of a function changes, but not when that of a function which it calls does: such
    functions lie in one file, or that other file says so.
    """
    return _compiled(function, _ROUNDING)


def compiled_sums(function: Function) -> Function:
    """As ``compiled``, but sums over a loop are added in the order that is quickest, always the same on a processor."""
    return _compiled(function, _ROUNDING | {"reassoc"})


def _compiled(function: Function, freedom: set[str]) -> Function:
    if not AVAILABLE:
        return function
    try:
        return _compile(cache=True, fastmath=freedom, **_OPTIONS)(function)
    except RuntimeError:  # no folder for the cache can be written to
        return _compile(fastmath=freedom, **_OPTIONS)(function)


def usable(*given: Tensor) -> bool:
    """Whether compiled functions can work on tensors: Numba is there, and they are on the CPU and need no gradient."""
    differentiated = torch.is_grad_enabled() and any(tensor.requires_grad for tensor in given)
    return AVAILABLE and not differentiated and all(tensor.is_cpu for tensor in given)
