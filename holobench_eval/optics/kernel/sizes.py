"""Sizes of transforms that the compiled kernel is made for, and the steps of each."""

from __future__ import annotations

import math
from functools import cache, lru_cache
from itertools import combinations_with_replacement

import numpy as np
import numpy.typing as npt
from scipy.fft import next_fast_len

Steps = tuple[int, npt.NDArray[np.int64], npt.NDArray[np.float32]]

LANES = 16
"""Lines that the kernel transforms at once."""
RADICES = (16, 15, 12, 10, 9, 8, 5, 4, 3, 2)
FEWEST_STEPS, MOST_STEPS = 2, 4
OVERHEAD = 1.5
"""Time of the work around a transform, in steps (measured from 512 to 3840 samples)."""
LARGER = 1.1
"""A size that takes fewer steps may be larger by this factor."""


@cache
def _radices() -> dict[int, tuple[int, ...]]:
    """The radices of every size: the fewest, and of these the most even ones."""
    found: dict[int, tuple[int, ...]] = {}
    for count in range(FEWEST_STEPS, MOST_STEPS + 1):
        for chosen in sorted(combinations_with_replacement(RADICES, count), key=sum):
            found.setdefault(math.prod(chosen), chosen)
    return found


@lru_cache(maxsize=1024)
def fast_size(least: int) -> int:
    """The size of the quickest transform of at least so many samples, and of few more.

    Examples
    --------
    >>> fast_size(2157), fast_size(2940)
    (2160, 3072)
    """
    sizes = [size for size in _radices() if size >= least]
    if not sizes:
        return int(next_fast_len(least))
    most = max(min(sizes), int(LARGER * least))
    return min(
        (size for size in sizes if size <= most), key=lambda size: (size * (len(_radices()[size]) + OVERHEAD), size)
    )


@lru_cache(maxsize=64)
def steps(size: int) -> Steps | None:
    """Size and radices of a transform, and the complex factors of its steps one after the other; None for other sizes.

    The factors of a step of radix r that follows steps of a product s are exp(-2 pi i p k / (size / s)), for p below
    size / (s r) and k from 1 to r - 1.
    """
    radices = _radices().get(size)
    if radices is None:
        return None
    factors, left = [], size
    for radix in radices:
        angles = -2 * np.pi / left * np.outer(np.arange(left // radix), np.arange(1, radix))
        factors.append(np.stack([np.cos(angles), np.sin(angles)], -1).ravel())
        left //= radix
    return size, np.array(radices), np.concatenate(factors).astype(np.float32)
