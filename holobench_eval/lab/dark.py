"""Counts without light, and the one place that takes them off.

Given as ``dark``, of ``holoeval score``, of a session and of a bench file alike: a level, in counts of the photographs,
or a file, a photograph or the mean of several that were taken with the light off.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.errors import UserError
from ..datasets.images import read
from .counts import read_counts


@dataclass(frozen=True, eq=False)
class Dark:
    """Counts without light: bias and, for every unit of exposure, rate; of each sample, or numbers for all of them."""

    bias: NDArray[Any]
    rate: NDArray[Any] | float = 0.0

    def at(self, exposure: float) -> NDArray[Any]:
        """Counts of an exposure."""
        return np.asarray(self.bias.astype(np.result_type(self.bias, np.float32)) + self.rate * exposure)

    def off(self, counts: NDArray[Any], exposure: float = 0.0) -> NDArray[Any]:
        """Counts of a photograph above the dark ones, in floating point: what noise has made negative stays so."""
        dark = self.at(exposure)
        if dark.size > 1 and dark.shape != counts.shape:
            sizes = (" x ".join(map(str, array.shape)) for array in (dark, counts))
            raise UserError("the dark frame has {} samples and the photograph {}; expected the same".format(*sizes))
        kinds = self.bias.dtype, counts.dtype
        if kinds[0] != kinds[1] and all(kind.kind == "u" for kind in kinds):
            depths = [8 * kind.itemsize for kind in kinds]
            raise UserError("the dark frame has {} bits and the photograph {}; expected the same".format(*depths))
        return np.asarray(counts - dark)

    def plane(self, index: int) -> Dark:
        """That of one colour, of a dark frame ``(C, H, W)`` with all of them or with one for all."""
        bias = self.bias[min(index, len(self.bias) - 1)] if self.bias.ndim == 3 else self.bias
        return Dark(bias, self.rate)


def given_dark(given: str | float, upright: bool = False) -> tuple[Dark, str]:
    """The dark counts that somebody states, and what tells them from others.

    given: a level, or the path of a file; upright: photographs are turned as their EXIF orientation says. UserError for
    a file that is missing or no photograph.
    """
    try:
        level = float(given)
    except ValueError:
        path = Path(str(given))
        if not path.is_file():
            raise UserError(f"{path}: no such file; expected counts without light, as a level or a file") from None
        content = read(path)
        dark = Dark(read_counts(content, path, linear=True, upright=upright).values)
        return dark, hashlib.sha256(content).hexdigest()
    if not math.isfinite(level) or level < 0:
        raise UserError(f"dark {given}: expected counts without light, 0 or more, or a file")
    return Dark(np.array(level, dtype=np.float32)), f"{level:g}"
