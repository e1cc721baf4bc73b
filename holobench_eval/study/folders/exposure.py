"""Whether a capture has levels enough: the rounding to a few of them would decide its score."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from torch import Tensor

from ...imaging.similarity import Mask
from ...imaging.warp import Frame, Warp

NAMES = ("red", "green", "blue")
ENDS = (1.0, 99.0)  # percentiles between which levels are counted; beyond them pixels may be hot or dead
FEWEST_LEVELS = 8  # rounding to so many leaves an error of 29 dB, as large as that of a good hologram
SAMPLED = 400  # pixels a side of the sample that is enough where it has more levels
SMALLEST_OBJECT = 16  # connected pixels of a sparse scene; hot pixels stand alone
DARK = 0.1  # of full scale
MUCH = 0.1  # of the pixels at full scale


@dataclass(frozen=True)
class Levels:
    """The levels of brightness of one channel.

    most: how many there are between the `ENDS`, or at least so many; bright: how many what is brighter has, where these
    are few, for a few bright things in the dark; top: the upper one of the `ENDS`; full: share of pixels at full scale.
    """

    most: int
    bright: int
    top: float
    full: float

    @property
    def any(self) -> int:
        """How many there are, in a picture that may be sparse."""
        return max(self.most, self.bright)


def levels(plane: Frame, mask: Mask | None = None) -> Levels:
    """The levels of a plane ``(h, w)``, or of those of its pixels that a mask has."""
    mask = np.ones(plane.shape, dtype=bool) if mask is None else mask
    step = max(1, min(plane.shape) // SAMPLED)
    full = float((plane[mask] >= 1).mean())
    most, top = _between_ends(plane[::step, ::step], mask[::step, ::step])
    if most > FEWEST_LEVELS:
        return Levels(most, 0, top, full)
    most, top = _between_ends(plane, mask)
    brighter = ((plane > top) & mask).astype(np.uint8)
    _, labels, facts, _ = cv2.connectedComponentsWithStats(brighter, connectivity=8)
    large = facts[:, cv2.CC_STAT_AREA] >= SMALLEST_OBJECT
    large[0] = False  # what is not brighter
    bright = large[labels]
    return Levels(most, _between_ends(plane, bright)[0] if bright.any() else 0, top, full)


def area(plane: Frame, warp: Warp) -> tuple[tuple[slice, slice], Mask]:
    """Where a capture's channel shows the target: rows and columns around it, and which of their pixels do."""
    corners = warp.corners()[[0, 1, 3, 2]]
    mask = cv2.fillConvexPoly(np.zeros(plane.shape, np.uint8), np.round(corners).astype(np.int32), (1,)).astype(bool)
    lowest, highest = np.floor(corners.min(0)).astype(int), np.ceil(corners.max(0)).astype(int)
    columns, rows = (slice(max(0, low), high + 2) for low, high in zip(lowest, highest, strict=True))
    return (rows, columns), mask[rows, columns]


def within(plane: Frame, warp: Warp) -> Levels:
    """The levels of a capture's channel where it shows the target. A lamp or a date beside it adds none."""
    part, mask = area(plane, warp)
    return levels(plane[part], mask)


def refusal(pairs: Iterable[tuple[str, Levels, Levels]], aligned: bool) -> str:
    """Why a capture has too few levels; empty where it has enough.

    pairs: name, levels of the capture and levels of the target, of every channel that has much of the target's light;
    aligned: levels of the capture are those `within` the target, where bright things count in a sparse target alone.
    """
    for name, capture, target in pairs:
        is_sparse = target.most <= FEWEST_LEVELS
        found = capture.any if is_sparse or not aligned else capture.most
        # A bright picture of few levels may be an honest one of a target that has no more, such as black and white.
        if found > FEWEST_LEVELS or (capture.top > DARK and target.any <= FEWEST_LEVELS):
            continue
        whose = f"its {name} channel" if name else "it"
        counted = f"{whose} has {found} level{'s' * (found != 1)} of brightness"
        if capture.full > MUCH:
            return f"the capture is over-exposed: {capture.full:.0%} of it is at full scale, and {counted}"
        return (
            f"the capture is under-exposed: {counted}, to which an offset or a stretch adds none, and whose rounding "
            f"would decide the score; more than {FEWEST_LEVELS} are needed, and a well exposed capture has a hundred"
        )
    return ""


def burnt(frame: Frame) -> str:
    """What to add to the refusal of a capture ``(C, h, w)`` of which much is at full scale."""
    full = float((frame >= 1).mean())
    return f"; {full:.0%} of the capture is at full scale, so it may be over-exposed" if full > MUCH else ""


def _between_ends(plane: Frame, mask: Mask) -> tuple[int, float]:
    """How many levels the pixels of a mask have between the `ENDS`, and the upper end; of all where it has none."""
    values = plane[mask] if mask.any() else plane
    low, high = np.percentile(values, ENDS)
    return len(np.unique(values[(values >= low) & (values <= high)])), float(high)


def darkest(image: Tensor, reference: Tensor) -> float:
    """How much brighter a capture ``(C, h, w)`` is where it is darkest than the target is, in parts of its white.

    By the 1st percentiles, a capture brought to the mean of its target; of the channels that have much of the target's
    light the largest. A constant in all counts lifts it, and so do haze and stray light.
    """
    means = reference.mean((-2, -1))
    lifted = [
        float(np.percentile(own, ENDS[0]) * mean / abs(own.mean()) - np.percentile(its, ENDS[0]))
        for own, its, mean in zip(image.numpy(), reference.numpy(), means.tolist(), strict=True)
        if mean >= MUCH * float(means.max()) and own.mean() != 0
    ]
    return max(lifted, default=0.0)
