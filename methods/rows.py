"""Work on rows of the panel, shared among threads: by compiled functions where these can be, by torch elsewhere.

torch's own threads would watch for work for milliseconds after each operation, and take the core from these.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from ..core.compiled import usable
from ..optics.blocks import in_blocks
from .kernels import Floats


def in_rows(compiled: Callable[..., object], in_torch: Callable[..., object], *arrays: Tensor) -> None:
    """Call one of two functions with blocks of the same rows of arrays ``(B, H, W)``, no gradients recorded.

    The compiled one takes complex arrays as ``(rows, 2 W)``, real and imaginary parts in turn.
    """
    first = arrays[0]
    if compilable(*arrays):
        given = [floats(array.flatten(0, -2)) for array in arrays]
        in_blocks(lambda some: compiled(*(rows[some] for rows in given)), first, len(given[0]), first.numel())
    else:
        in_blocks(
            lambda some: in_torch(*(array[..., some, :] for array in arrays)), first, first.shape[-2], first.numel()
        )


def compilable(*arrays: Tensor) -> bool:
    """Whether compiled functions can work on arrays, which they take for contiguous and of single precision."""
    single = all(array.dtype in (torch.float32, torch.complex64) and array.is_contiguous() for array in arrays)
    return single and usable(*arrays)


def floats(array: Tensor) -> Floats:
    """The memory of a contiguous array, real and imaginary parts in turn."""
    found: Floats = (torch.view_as_real(array).flatten(-2) if array.is_complex() else array).numpy()
    return found
