"""Work on large arrays, shared among threads: each takes parts of it and works on these alone.

Were every operation shared instead, the threads would wait for each other after every one, which takes far longer than
the work as soon as another program wants a core.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from itertools import count, pairwise

import torch
from torch import Tensor

BLOCK_BYTES = 2**21
"""Of a block: measured, 1 to 4 MiB are best for propagations from 256 x 256 to 2160 x 3840 pixels."""


def in_blocks(work: Callable[[slice], object], like: Tensor, lines: int, elements: int) -> None:
    """Call ``work`` with slices of ``lines`` that hold ``elements`` of the type of ``like`` in all; without gradients.

    A block stays in the cache of the core that works on it. On a GPU there is one block.
    """
    blocks = min(lines, math.ceil(elements * like.element_size() / BLOCK_BYTES)) if like.is_cpu else 1
    work = torch.inference_mode(torch.is_inference_mode_enabled())(torch.no_grad()(work))  # modes are a thread's own
    in_parts(lambda first, last: work(slice(first, last)), lines, blocks)


def in_parts(work: Callable[[int, int], object], lines: int, parts: int) -> None:
    """Call ``work`` with the ends of ``parts`` ranges that make up ``lines``, in as many threads as torch has."""
    if lines == 0 or parts == 0:
        return
    parts = min(parts, lines)
    ends = [lines * part // parts for part in range(parts + 1)]
    threads = min(torch.get_num_threads(), parts)
    ranges, numbers = list(pairwise(ends)), count()
    if threads == 1:
        for first, last in ranges:
            work(first, last)
        return

    def some() -> None:
        while (number := next(numbers)) < parts:  # one thread at a time counts on
            work(*ranges[number])

    before = torch.get_num_threads()
    helpers = [helper.submit(some) for helper in _helpers(threads - 1)]
    torch.set_num_threads(1)
    try:
        some()
        for helper in helpers:
            if not helper.cancel():
                helper.result()
    finally:
        torch.set_num_threads(before)


@lru_cache(maxsize=4)
def _helpers(number: int) -> list[ThreadPoolExecutor]:
    """Threads with a queue each: of those that wait at one queue, only the first is woken for two tasks at once."""
    return [
        ThreadPoolExecutor(1, "holobench_eval", initializer=torch.set_num_threads, initargs=(1,)) for _ in range(number)
    ]


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_helpers.cache_clear)  # a child process has none of its parent's threads
