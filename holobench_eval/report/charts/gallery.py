"""The pictures behind a comparison figure: thumbnails of targets and captures, the crop to enlarge, the error map."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ...core.errors import PictureError
from ...core.pictures import open_picture

Picture = NDArray[np.float64]
T = TypeVar("T")

CROP_FRACTION = 9  # of a side of the picture: four times enlarged, two windows fit below it


@dataclass(frozen=True)
class Crop:
    """A window of a picture, in pixels."""

    top: int
    left: int
    height: int
    width: int

    def of(self, picture: Picture) -> Picture:
        """The window of ``picture`` ``(h, w, 3)``; a view."""
        return picture[self.top : self.top + self.height, self.left : self.left + self.width]


@dataclass(frozen=True)
class Tile:
    """One capture in a comparison: the picture ``(h, w, 3)`` sRGB in [0, 1], or None and the note why it is absent."""

    picture: Picture | None
    note: str


@dataclass(frozen=True)
class Column:
    """All captures of one method under one condition, in the order of the figure's targets."""

    title: str
    tiles: tuple[Tile, ...]


def load_picture(path: Path) -> Picture | None:
    """A thumbnail as ``(h, w, 3)`` sRGB values in [0, 1]; None when the file is not there or damaged."""
    try:
        levels = open_picture(path.read_bytes()).values()
    except (OSError, PictureError):
        return None
    picture = levels.astype(np.float64) / 255
    if picture.ndim == 2:
        picture = np.repeat(picture[..., None], 3, axis=2)
    return picture


def most_detailed(target: Picture, fraction: int = CROP_FRACTION) -> Crop:
    """The window of ``target`` with the largest summed gradient magnitude; the first one where windows tie.

    fraction: how many times smaller than the picture's its sides are.
    """
    height, width = target.shape[:2]
    rows, columns = max(1, height // fraction), max(1, width // fraction)
    vertical, horizontal = np.gradient(target.mean(axis=2))
    detail = np.hypot(vertical, horizontal)
    summed = np.pad(detail.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    windows = summed[rows:, columns:] - summed[:-rows, columns:] - summed[rows:, :-columns] + summed[:-rows, :-columns]
    # Six decimals: summation order must not decide between equal windows.
    top, left = np.unravel_index(int(np.argmax(np.round(windows, 6))), windows.shape)
    return Crop(int(top), int(left), rows, columns)


def error_map(capture: Picture, target: Picture) -> NDArray[np.float64]:
    """``(h, w)`` absolute difference of sRGB values, mean over the three channels, in [0, 1]."""
    error: NDArray[np.float64] = np.abs(capture - target).mean(axis=2)
    return error


def error_limit(errors: Sequence[NDArray[np.float64]]) -> float:
    """The upper end of the shared error scale: the 99th percentile of all errors, rounded up to a tenth."""
    high = float(np.quantile(np.concatenate([error.ravel() for error in errors]), 0.99))
    return min(1.0, max(0.1, math.ceil(high * 10 - 1e-9) / 10))


def spread(items: Sequence[T], most: int) -> list[T]:
    """``most`` items or all where they are no more, evenly spaced from first to last, in their order."""
    picks = np.linspace(0, len(items) - 1, min(most, len(items))).round().astype(int)
    return [items[index] for index in picks]
