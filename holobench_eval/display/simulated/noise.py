"""Normal numbers that depend on a key and their place in a frame alone, whichever thread draws them."""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor

from ...core.compiled import usable
from .kernels import normal_rows, philox


def normal(key: int, rows: slice, columns: int) -> Tensor:
    """Standard normal numbers of some rows of a frame.

    Parameters
    ----------
    key
        Of the frame, 0 to 2^64 - 1. Other keys give independent numbers.
    rows
        From start to stop; the numbers of a row are the same in every block of rows.
    columns
        Of the frame; another width gives other numbers.

    Returns
    -------
    Tensor
        ``(rows, columns)``, float32, at most 5.9 in size: by Philox4x32-10 and Box-Muller, with 24 bits of the words.

    Examples
    --------
    >>> bool((normal(7, slice(0, 9), 5)[4:] == normal(7, slice(4, 9), 5)).all())
    True
    """
    quarter = math.ceil(columns / 4)
    numbers = np.empty((rows.stop - rows.start, 4, quarter), np.float32)
    halves = np.uint64(key & 0xFFFFFFFF), np.uint64(key >> 32)
    if usable():
        normal_rows(rows.start, halves, numbers)
    else:
        counters = np.arange(quarter, dtype=np.uint64), np.arange(rows.start, rows.stop, dtype=np.uint64)[:, None]
        words = philox(*counters, halves)
        for pair in (0, 2):
            radius = np.sqrt(-2 * np.log(((words[pair] >> np.uint64(8)) + 0.5) * 2**-24))
            angle = words[pair + 1] * (2 * math.pi * 2**-32)
            numbers[:, pair], numbers[:, pair + 1] = radius * np.cos(angle), radius * np.sin(angle)
    return torch.from_numpy(numbers.reshape(len(numbers), -1)[:, :columns]).contiguous()
