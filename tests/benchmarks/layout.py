"""Where arrays lie decides how long work on them takes: drawn anew for every measurement, it counts as chance.

An array that is freed and asked for again may get its old place in glibc's heap or another one, by what happens to lie
beside it. A propagation so goes round two arrays, which stay in the cache, or three or four, which do not. Left alone,
that is settled when a process begins: the same propagation of 540x960 pixels takes 6 ms in one and 9 ms in another.
"""

import random

import torch

BLOCKS, SMALLEST, LARGEST = 12, 2**16, 2**24
"""How many arrays are put in the way, half of which stay there, and their bytes."""


class Layout:
    """Blocks in the heap, of sizes and at places that a seed decides."""

    def __init__(self, seed):
        self.draw, self.held = random.Random(seed), []

    def redraw(self):
        """Free the blocks and put others in other places. What is there already stays where it is."""
        self.held = []
        blocks = [torch.empty(self.draw.randrange(SMALLEST, LARGEST), dtype=torch.uint8) for _ in range(BLOCKS)]
        self.held = self.draw.sample(blocks, BLOCKS // 2)
