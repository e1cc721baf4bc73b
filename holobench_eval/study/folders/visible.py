"""The part of a target that its captures show: one part for all of them, so that their scores can be compared."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...imaging.align import OVERHANG
from ...imaging.similarity import Mask
from ...imaging.warp import Frame, Warp

LEAST = 0.5  # of a target's pixels

Part = tuple[int, int, int, int]  # first row, row after the last, first column, column after the last


def shown(warp: Warp, frame: tuple[int, ...]) -> Mask:
    """Which pixels of a target ``(h, w)`` lie on a capture of ``frame`` rows and columns.

    All, where no more lies beyond the border than any capture may lack.
    """
    x, y = warp.coordinates()
    beyond = max(float(-min(x.min(), y.min())), float(x.max()) - frame[1] + 1, float(y.max()) - frame[0] + 1)
    if beyond <= OVERHANG * warp.scale():
        return np.ones(warp.shape, dtype=bool)
    return np.asarray((x >= 0) & (y >= 0) & (x <= frame[1] - 1) & (y <= frame[0] - 1))


def largest_part(mask: Mask) -> Part:
    """A rectangle of pixels that are all shown: the edge with most that are not is moved in until none is left.

    For masks that are convex, as of a display seen by a camera. A rectangle without pixels where none is shown.
    """
    top, left, (bottom, right) = 0, 0, mask.shape
    while top < bottom and left < right:
        window = mask[top:bottom, left:right]
        hidden = [1 - float(edge.mean()) for edge in (window[0], window[-1], window[:, 0], window[:, -1])]
        if max(hidden) == 0:
            break
        worst = int(np.argmax(hidden))
        top, bottom, left, right = top + (worst == 0), bottom - (worst == 1), left + (worst == 2), right - (worst == 3)
    return top, bottom, left, right


def share(part: Part, shape: tuple[int, ...]) -> float:
    """The share of a target ``(h, w)`` that a part has."""
    return max(0, part[1] - part[0]) * max(0, part[3] - part[2]) / (shape[0] * shape[1])


def cropped(warp: Warp, part: Part) -> Warp:
    """The map from pixels of a part of a target to those of the capture."""
    shift = np.array([[1.0, 0, part[2]], [0, 1, part[0]], [0, 0, 1]])
    return replace(warp, shape=(part[1] - part[0], part[3] - part[2]), homography=warp.homography @ shift)


def part_of(picture: Frame, part: Part | None) -> Frame:
    """A part of ``(C, h, w)``, or all of it."""
    return picture if part is None else np.ascontiguousarray(picture[:, part[0] : part[1], part[2] : part[3]])
