"""Work on large arrays a block at a time, so that a block stays in the cache of the core that works on it."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache

import torch
from torch import Tensor

BLOCK_BYTES = 2**21
"""Of a block: measured, 1 to 4 MiB are best for propagations from 256 x 256 to 2160 x 3840 pixels."""


def in_blocks(work: Callable[[slice], None], like: Tensor, lines: int, elements: int) -> None:
    """Call ``work`` with slices of ``lines`` that hold ``elements`` of the type of ``like`` in all; without gradients.

    Blocks are shared among as many threads as torch has, each working alone: were every operation shared instead, the
    threads would wait for each other after every one, which takes far longer than the work as soon as another program
    wants a core. On a GPU there is one block.
    """
    count = min(lines, math.ceil(elements * like.element_size() / BLOCK_BYTES)) if like.is_cpu else 1
    slices = [slice(lines * block // count, lines * (block + 1) // count) for block in range(count)]
    threads = torch.get_num_threads()
    work = torch.inference_mode(torch.is_inference_mode_enabled())(torch.no_grad()(work))  # modes are a thread's own
    if threads == 1 or count == 1:
        for block in slices:
            work(block)
        return
    try:
        for _ in _pool(threads).map(work, slices):
            pass
    finally:
        torch.set_num_threads(threads)  # a new thread of the pool has changed what later threads begin with


@lru_cache(maxsize=4)
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, "holobench_eval", initializer=torch.set_num_threads, initargs=(1,))


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)  # a child process has none of its parent's threads
