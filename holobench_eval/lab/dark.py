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
    """Counts without light: bias and, for every unit of exposure, rate; of each sample, or numbers for all of them.

    full: the count of full scale of the file that they come from, 1 for numbers that never exceed 1; None where
    nothing is known of the scale.
    """

    bias: NDArray[Any]
    rate: NDArray[Any] | float = 0.0
    full: float | None = None

    def at(self, exposure: float) -> NDArray[Any]:
        """Counts of an exposure."""
        return np.asarray(self.bias.astype(np.result_type(self.bias, np.float32)) + self.rate * exposure)

    def off(self, counts: NDArray[Any], exposure: float = 0.0) -> NDArray[Any]:
        """Counts of a photograph above the dark ones, in floating point: what noise has made negative stays so."""
        dark = self.at(exposure)
        if dark.size > 1 and dark.shape != counts.shape:
            sizes = (" x ".join(map(str, array.shape)) for array in (dark, counts))
            raise UserError("the dark frame has {} samples and the photograph {}; expected the same".format(*sizes))
        if counts.dtype.kind == "u":
            self.refuse_other_scale(np.iinfo(counts.dtype).max)
        return np.asarray(counts - dark)

    def refuse_other_scale(self, full: float) -> None:
        """UserError where photographs whose full scale is ``full`` counts cannot be on the scale of these."""
        if self.full == 1 and not (self.bias.ndim == 0 and full <= 255):  # of which a level may be a part of a count
            what = "level is below 1" if self.bias.ndim == 0 else "frame never exceeds 1"
            raise UserError(f"the dark {what} and the photograph counts to {full:g}; expected its counts")
        if self.full is not None and (self.full > 255) != (full > 255):  # a camera of 12 bits writes files of 16
            depths = [16 if each > 255 else 8 for each in (self.full, full)]
            raise UserError("the dark frame has {} bits and the photograph {}; expected the same".format(*depths))

    def plane(self, index: int) -> Dark:
        """That of one colour, of a dark frame ``(C, H, W)`` with all of them or with one for all."""
        bias = self.bias[min(index, len(self.bias) - 1)] if self.bias.ndim == 3 else self.bias
        return Dark(bias, self.rate, self.full)


def given_dark(given: str | float, upright: bool = False) -> tuple[Dark, str]:
    """The dark counts that somebody states, and what tells them from others.

    given: a level, or the path of a file; upright: photographs are turned as their EXIF orientation says. UserError for
    a file that is missing, no photograph, or compressed with loss.
    """
    try:
        level = float(given)
    except ValueError:
        path = Path(str(given))
        if not path.is_file():
            raise UserError(f"{path}: no such file; expected counts without light, as a level or a file") from None
        content = read(path)
        counts = read_counts(content, path, linear=True, upright=upright)
        if counts.is_lossy:
            raise UserError(
                f"{path}: compressed with loss, no counts; expected a PNG, TIFF, .npy or RAW file, or a level"
            ) from None
        mean, noise = float(counts.values.mean()), float(counts.values.std())
        if mean < -noise:  # noise alone may put it below zero where dark counts were taken off before
            raise UserError(f"{path}: {mean:.4g} on average; expected counts without light, 0 or more") from None
        full = counts.white if counts.values.dtype.kind == "u" else 1.0 if 0 < counts.white <= 1 else None
        return Dark(counts.values, full=full), hashlib.sha256(content).hexdigest()
    if not math.isfinite(level) or level < 0:
        raise UserError(f"dark {given}: expected counts without light, 0 or more, or a file")
    return Dark(np.array(level, dtype=np.float32), full=1.0 if 0 < level < 1 else None), f"{level:g}"
