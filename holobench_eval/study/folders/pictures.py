"""A picture file of ``holoeval score``: checked when it is first read, and decoded without a guess."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...core.errors import UserError
from ...datasets.images import RIGHT as RIGHT_FOR_DATASETS
from ...datasets.images import read
from ...imaging.similarity import reduced
from ...lab.counts import RIGHT, Counts, read_counts, step
from ...lab.dark import Dark
from ...lab.session.checks import DEPTHS
from .exposure import Levels, levels

SUFFIXES = (".png", ".tif", ".tiff", ".bmp", ".webp", ".jpg", ".jpeg")
SMALLEST = 32  # pixels a side
WIDEST = 16_384  # pixels a side
NEARLY_GRAY = 3 / 255  # by which the channels of a gray picture differ that was stored in colour, as in a JPEG
EXCEPT = 1e-3  # of the pixels, which may differ by more
ROUNDING = 1e-6
FACTS_SIDE = 96  # pixels of the longer side to which noise is averaged away

Values = NDArray[np.float32]


@dataclass(frozen=True)
class Picture:
    """A picture file that was read once and is valid.

    shape: ``(C, h, w)``, C = 1 or 3; sha256: of the file; pixels_sha256: of its values. gray: whether all channels are
    equal; nearly_gray: whether they are so within `NEARLY_GRAY`, but not equal; opaque: whether an alpha channel was
    left out that is opaque everywhere; is_lossy: whether it was compressed with loss; is_linear: whether its values
    are linear in light by their kind, a RAW file's or floating point. structure: standard deviation of each channel's
    values, noise averaged away; levels: of each channel, whatever their brightness; full: the value from which a sample
    is clipped; white: the count of full scale; step: all counts are multiples of it, as far as is known; dark: counts
    without light.
    """

    path: Path
    shape: tuple[int, int, int]
    sha256: str
    pixels_sha256: str
    gray: bool
    nearly_gray: bool
    opaque: bool
    is_lossy: bool
    is_linear: bool
    structure: tuple[float, ...]
    levels: tuple[Levels, ...]
    full: float
    white: float
    step: int
    dark: Dark | None

    def load(self) -> Values:
        """Its values ``(C, h, w)`` as stored, over full scale. UserError if it was changed.

        Of a RAW file: counts above its black, over those of white; of floating point: over the highest value.
        """
        return _values(self._counts())

    def light(self) -> Values:
        """As ``load``, with the dark counts taken off where there are some: noise may make it negative."""
        counts = self._counts()
        return _values(counts) if self.dark is None else _light(counts, self.dark)

    def _counts(self) -> Counts:
        content = read(self.path)
        if hashlib.sha256(content).hexdigest() != self.sha256:
            raise UserError(f"{self.path}: changed while it was being scored; start again")
        return read_counts(content, self.path, linear=True)


def checked(path: Path, linear: bool = False, dark: Dark | None = None) -> Picture:
    """A picture file, read and looked at. UserError for one that is damaged, of another kind, or of another size.

    linear: it may say that its values are proportional to light, and not only that they are sRGB; dark: counts without
    light, of its size, above which it has to have some.
    """
    try:
        content = read(path)
    except UserError as error:
        raise UserError(str(error).replace(RIGHT_FOR_DATASETS, RIGHT)) from error
    counts = read_counts(content, path, linear)
    if counts.white <= 0:
        raise UserError(f"{path}: no value is above 0; expected a capture with the light on")
    values = _values(counts)
    channels, height, width = values.shape
    if min(height, width) < SMALLEST or max(height, width) > WIDEST:
        raise UserError(f"{path}: {width} x {height} pixels; expected sides from {SMALLEST} to {WIDEST} pixels")
    if dark is not None:
        try:
            mean = float(_light(counts, dark).mean())
        except UserError as error:
            raise UserError(f"{path}: {error}") from error
        if mean <= 0:
            raise UserError(f"{path}: on average no brighter than the dark counts; expected one with the light on")
    gray = all(np.array_equal(plane, values[0]) for plane in values[1:])
    return Picture(
        path,
        (channels, height, width),
        hashlib.sha256(content).hexdigest(),
        hashlib.sha256(repr(values.shape).encode() + values.tobytes()).hexdigest(),
        gray=gray,
        nearly_gray=not gray and float((np.ptp(values, axis=0) > NEARLY_GRAY + ROUNDING).mean()) <= EXCEPT,
        opaque=counts.is_opaque,
        is_lossy=counts.is_lossy,
        is_linear=counts.is_linear,
        structure=tuple(float(np.std(reduced(plane, FACTS_SIDE)[0])) for plane in values),
        levels=tuple(levels(plane) for plane in values),
        full=_full(counts),
        white=counts.white,
        step=step(counts.values) if counts.values.dtype.kind == "u" and not counts.is_raw else 1,
        dark=dark,
    )


def _light(counts: Counts, dark: Dark) -> Values:
    return np.asarray(dark.off(counts.values) / (np.float32(counts.white) - counts.black), dtype=np.float32)


def _full(counts: Counts) -> float:
    """The value from which a sample is clipped: full scale, or the last level of fewer bits, if the highest is that.

    Counts of 12 bits end at 4095 where they lie at the lower end of 16, and at 65520 at the upper one. Floating point
    has no full scale.
    """
    if counts.values.dtype.kind == "f":
        return math.inf
    highest = int(counts.values.max())
    if counts.values.dtype != np.uint16 or counts.is_raw or not highest:
        return 1.0
    return highest / counts.white if highest + step(counts.values) in {2**bits for bits in DEPTHS} else 1.0


def _values(counts: Counts) -> Values:
    """Counts above the black that the file states, over those of full scale."""
    values = (counts.values - counts.black) / (np.float32(counts.white) - counts.black)
    return np.ascontiguousarray(values, dtype=np.float32)
