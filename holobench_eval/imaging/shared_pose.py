"""One alignment for captures that were taken in one pose, and a capture's values on the pixels of its target."""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping
from dataclasses import replace
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from .align import OVERHANG, Alignment
from .warp import Warp

AGREE = 1.0  # capture pixels, or target pixels where those are larger: corners further apart are another pose
CLOSE = 0.25  # capture pixels, rms over the target: where a capture's own pose is further away, the camera has moved
GRID = 9  # points a side at which that is measured

Key = TypeVar("Key", bound=Hashable)


def shared(alignments: Mapping[Key, Alignment]) -> tuple[Warp, frozenset[Key]] | None:
    """One warp for captures in one pose, and for which of several alignments it may stand; None where there is none.

    For captures of one size and targets of one shape. Alignments agree whose corners lie within `AGREE` of their
    median. Each has an error of its own, by the speckle of its capture; the common corners are their mean, weighted by
    the inverse of the variance that a correlation leaves unexplained. It stands for those that it is `CLOSE` to, if
    these are two or more. Where no two agree, it is the best correlated one, which stands for no other.
    """
    if not alignments:
        return None
    corners = {key: alignment.warp.corners() for key, alignment in alignments.items()}
    middle = np.median(list(corners.values()), axis=0)
    best = max(alignments.values(), key=lambda alignment: alignment.correlation).warp
    allowed = AGREE * max(1.0, best.scale())
    near = [key for key in alignments if np.linalg.norm(corners[key] - middle, axis=1).max() <= allowed]
    if len(near) < 2:
        return best, frozenset()
    weights = [1 / max(1 - alignments[key].correlation ** 2, 1e-6) for key in near]
    common = np.average([corners[key] for key in near], axis=0, weights=weights)
    height, width = best.shape
    ends = np.array([[0, 0], [width - 1, 0], [0, height - 1], [width - 1, height - 1]], dtype=np.float32)
    homography = cv2.getPerspectiveTransform(ends, common.astype(np.float32))
    warp = replace(best, homography=np.asarray(homography, dtype=np.float64))
    close = frozenset(key for key in near if _apart(warp, alignments[key].warp) <= CLOSE)
    return warp, close if len(close) > 1 else frozenset()


def _apart(first: Warp, second: Warp) -> float:
    """Root mean square over the target of the distance [capture px] between where two warps put a pixel."""
    rows, columns = (np.linspace(0, side - 1, GRID) for side in first.shape)
    points = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    return float(np.sqrt(np.square(first.to_sensor(points) - second.to_sensor(points)).sum(axis=1).mean()))


def sampled(capture: NDArray[np.float32], warp: Warp) -> NDArray[np.float32]:
    """A capture ``(C, Hs, Ws)`` on the pixels of its target, ``(C, h, w)``.

    Where the capture is finer than the target, each target pixel is the mean over its area, as a camera with pixels of
    this size would have seen it; else it is interpolated (bilinear, as cubic overshoots at the edges of speckle).
    """
    fineness = max(1, math.ceil(warp.scale() - 0.05))
    reach = math.ceil(OVERHANG * warp.scale()) + 1
    padded = [np.pad(plane, reach, mode="edge") for plane in capture]
    total = np.zeros((len(padded), *warp.shape), dtype=np.float64)
    steps = (np.arange(fineness) + 0.5) / fineness - 0.5
    for y in steps:
        for x in steps:
            offset = np.array([[1, 0, x], [0, 1, y], [0, 0, 1]])
            across, down = replace(warp, homography=warp.homography @ offset).coordinates()
            across, down = across + reach, down + reach
            for plane, seen in zip(padded, total, strict=True):
                seen += cv2.remap(plane, across, down, cv2.INTER_LINEAR)
    total /= fineness**2
    return total.astype(np.float32)
