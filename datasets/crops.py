"""Crops of photographs at their own resolution, and renderings: enough pictures for a difference to show."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import count, islice
from typing import Annotated, ClassVar, NamedTuple

import torch
from annotated_types import Interval
from torch import Tensor

from ..core.errors import UserError
from . import renderings, still_life
from .base import chosen, known, named_digest, with_channels
from .shipped import FILES, content_digest, decoded

VERSION = 1  # part of every digest of a crop: raise it when another rule places the crops

# without those that have no crop of 208 pixels: text is smaller, and at its own resolution retina is flat but for its
# black corners
NAMES = tuple(name for name in FILES if name not in ("text", "retina"))
STILL_LIFE, STILL_LIVES = "still-life", 2  # the renderings that come first, as they did before there were others

# Smallest contrast of a crop, linear light (rms difference from its mean colour): a constant image would score
# 26 dB on a flatter one, more than most captures score on anything.
FLAT = 0.05


class Crop(NamedTuple):
    """Where a crop lies: photograph, first row and column."""

    photograph: str
    top: int
    left: int


@dataclass(frozen=True)
class Crops:
    """Square crops, at native resolution, of the photographs inside scikit-image and matplotlib; and renderings.

    A centred grid of as many disjoint squares of ``size`` pixels as fit is laid over each photograph. Its crops are
    those nearest to its middle, as many as ``each`` says and the upper or left one of two equally near ones, without
    those whose contrast (rms difference from the mean colour, in linear light) is below 0.05. A crop is named by its
    place in the grid: ``astronaut-2`` is the second square, row by row. Crops of one photograph are one cluster. The
    photographs are decoded as sRGB.

    Renderings are two still lifes, then a landscape, a street, things on a table, stones, and so on in turn. Each is a
    cluster: its numbers are drawn independently of all others', so that a mean over renderings is one over what these
    generators draw. Those of a kind share its generator, and may be alike in what no interval counts: a report says
    beside its mean what photographs alone give.

    size: pixels a side; 208 is the region that is scored on a panel of 256 x 256. A smaller region shows the middle
    of a crop, a larger one is refused: nothing is resized. each: crops of a photograph, at most. names: the
    photographs, in this order; by default all that have such crops. renderings: how many.
    """

    size: Annotated[int, Interval(ge=32, le=4096)] = 208
    each: Annotated[int, Interval(ge=1, le=100)] = 1
    names: tuple[str, ...] = NAMES
    renderings: Annotated[int, Interval(ge=0, le=100)] = 26

    training: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """UserError for an unknown or repeated name."""
        chosen("photograph", self.names, NAMES)

    def items(self) -> list[str]:
        """``photograph-place``, photograph by photograph, then the renderings. UserError for one without a crop."""
        return [*self._places(), *islice(_names(), self.renderings)]

    def load(self, item: str, shape: tuple[int, int], channels: int = 3) -> Tensor:
        """The middle of a crop as ``(channels, *shape)`` linear light in [0, 1]. UserError for a larger shape."""
        rows, columns = shape
        place = self._place(item)
        if place is None:
            return with_channels(_rendered(item, shape), channels)
        if max(shape) > self.size:
            raise UserError(
                f"a crop of {self.size} x {self.size} pixels has no room for a target of {rows} x {columns}; "
                "choose a larger size, or the dataset photographs, which are enlarged"
            )
        top, left = place.top + (self.size - rows) // 2, place.left + (self.size - columns) // 2
        return with_channels(_cut(Crop(place.photograph, top, left), shape).clone(), channels)

    def digest(self, item: str) -> str:
        """SHA-256 of the photograph's file and of the place, or of the rendering's name."""
        place = self._place(item)
        if place is None:
            return named_digest(item, (still_life if _kind(item) == STILL_LIFE else renderings).VERSION)
        photograph = content_digest(place.photograph)
        return named_digest("crop", VERSION, photograph, place.top, place.left, self.size)

    def cluster(self, item: str) -> str:
        """The photograph of a crop; a rendering is a cluster of its own."""
        place = self._place(item)
        return item if place is None else place.photograph

    def _place(self, item: str) -> Crop | None:
        return self._places().get(known("crop", item, self.items()))

    def _places(self) -> dict[str, Crop]:
        """Where the crop of every item lies."""
        return {item: crop for name in self.names for item, crop in _best(name, self.size, self.each)}


def _names() -> Iterator[str]:
    """The renderings' names, without end."""
    yield from (f"{STILL_LIFE}-{number}" for number in range(1, STILL_LIVES + 1))
    yield from (f"{kind}-{number}" for number in count(1) for kind in renderings.SCENES)


def _kind(rendering: str) -> str:
    return rendering.rsplit("-", 1)[0]


def _rendered(item: str, shape: tuple[int, int]) -> Tensor:
    """``(3, *shape)``, in memory of its own."""
    if _kind(item) == STILL_LIFE:
        return torch.from_numpy(still_life.still_life(item, shape)[0]).permute(2, 0, 1).float().contiguous()
    return renderings.rendering(item, shape).clone()


@lru_cache(maxsize=256)
def _best(name: str, size: int, each: int) -> tuple[tuple[str, Crop], ...]:
    """Name and place of the crops of a photograph, row by row. UserError for a photograph without one."""
    picture = decoded(name)
    height, width = picture.shape[1:]
    rows, columns = height // size, width // size
    places = [(row, column) for row in range(rows) for column in range(columns)]
    nearest = sorted(places, key=lambda place: math.hypot(2 * place[0] - rows + 1, 2 * place[1] - columns + 1))
    top, left = (height - rows * size) // 2, (width - columns * size) // 2
    crops = {place: Crop(name, top + size * place[0], left + size * place[1]) for place in nearest}
    kept = [place for place, crop in crops.items() if _contrast(_cut(crop, (size, size))) >= FLAT][:each]
    found = tuple((f"{name}-{places.index(place) + 1}", crops[place]) for place in sorted(kept))
    if not found:
        raise UserError(
            f"photograph '{name}' has {height} x {width} pixels and no crop of {size} x {size} with a contrast of "
            f"{FLAT:g}; choose a smaller size, or leave it out of names"
        )
    return found


def _cut(crop: Crop, shape: tuple[int, int]) -> Tensor:
    """``(3, *shape)`` of a photograph."""
    rows, columns = slice(crop.top, crop.top + shape[0]), slice(crop.left, crop.left + shape[1])
    return decoded(crop.photograph)[:, rows, columns]


def _contrast(picture: Tensor) -> float:
    """Root mean square of the difference from the mean colour, of ``(3, h, w)``."""
    return float((picture - picture.mean((1, 2), keepdim=True)).square().mean().sqrt())
