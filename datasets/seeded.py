"""What a generated scene is drawn from: numbers, colours and fractal noise that hang from a name alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray

from ..core.seeds import generator
from ..optics import srgb_decode

Array = NDArray[np.float64]
Noise = Callable[[Array, Array], Array]

PERIOD = 64  # cells of a lattice of noise before it repeats


class Seeded:
    """Random numbers of a name, in the order in which they are asked for."""

    def __init__(self, *names: object) -> None:
        self._draw = generator(*names)

    def numbers(self, *shape: int) -> Array:
        """Uniform numbers from 0 to 1."""
        numbers: Array = torch.rand(*shape, generator=self._draw, dtype=torch.float64).numpy()
        return numbers

    def number(self, low: float = 0.0, high: float = 1.0) -> float:
        """A uniform number."""
        return low + (high - low) * float(self.numbers(1)[0])

    def side(self) -> int:
        """1 or -1."""
        return 1 if self.number() < 0.5 else -1

    def colour(self, light: float, strength: float, hue: float | None = None) -> Array:
        """``(3,)`` linear light: a level in sRGB, and how much of a hue (0 red, 1/3 green, 2/3 blue; None: any)."""
        turn = self.number() if hue is None else hue + self.number(-0.03, 0.03)
        channels = np.clip(np.abs((turn + np.array([0, 2 / 3, 1 / 3])) % 1 * 6 - 3) - 1, 0, 1)
        return srgb_decode(torch.from_numpy(light * (1 - strength * (1 - channels)))).numpy()

    def noise(self, octaves: int = 8, fall: float = 0.5) -> Noise:
        """A function of coordinates, about from -1 to 1: cells of 1, 1/2, 1/4 ..., each ``fall`` of the one before."""
        lattices = 2 * self.numbers(octaves, PERIOD, PERIOD) - 1

        def at(u: Array, v: Array) -> Array:
            total, gain = np.zeros(np.broadcast(u, v).shape), 1.0
            for lattice in lattices:
                i, j = np.floor(u), np.floor(v)
                a, b = u - i, v - j
                a, b = a * a * (3 - 2 * a), b * b * (3 - 2 * b)
                i, j = i.astype(np.int64) % PERIOD, j.astype(np.int64) % PERIOD
                i1, j1 = (i + 1) % PERIOD, (j + 1) % PERIOD
                first = lattice[i, j] + b * (lattice[i, j1] - lattice[i, j])
                second = lattice[i1, j] + b * (lattice[i1, j1] - lattice[i1, j])
                total += gain * (first + a * (second - first))
                gain *= fall
                # turned, so that the cells of two octaves never lie on one another
                u, v = 1.6 * u - 1.2 * v + 17.3, 1.2 * u + 1.6 * v + 5.1
            return total

        return at
