"""Find the circles of a fiducial grid in a speckled capture, and which circle is which."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from .grid import FiducialGrid
from .warp import Array, Frame

CIRCLE_BLUR = 0.35  # of a circle's radius: about 2 region pixels for the smallest circles, beyond the speckle grain
FILLED = (0.75, 0.5, 0.33, 1.0, 0.22)  # the part of the frame's side that the region may fill, likely ones first
DETECTION_RADIUS = 6.0  # pixels; larger circles are detected on a smaller picture
CLUTTER = 1.5  # blobs for each circle; the search among more is slow and hopeless
MARK_AGREEMENT = 0.8  # correlation of the circles' sizes with the marks: 0.86 and more in speckle, others below 0.76
MARK_MARGIN = 0.3  # by which no other order agrees as well, of what it is for perfect marks: 0.56 and more in speckle


def find_circles(frame: Frame, grid: FiducialGrid) -> Array | None:
    """Sensor coordinates ``(N, 2)`` of the grid's circles in the grid's order, or None.

    ``frame``: ``(Hs, Ws)`` linear light. How large the grid is on the sensor is not known beforehand, so sizes are
    tried in turn, each with several ways to even out the illumination.
    """
    largest = min(max(frame.shape) / max(grid.shape), min(frame.shape) / min(grid.shape))
    for filled in FILLED:
        for points in _find_at(frame, grid, filled * largest):
            ordered = _orient(frame, points, grid)
            if ordered is not None:
                return ordered
    return None


def _find_at(frame: Frame, grid: FiducialGrid, scale: float) -> Iterator[Array]:
    """The circles in any of the lattice's orders, when the sensor has about ``scale`` pixels a region pixel."""
    shrink = max(1, int(scale * grid.radius / DETECTION_RADIUS))
    height, width = (side // shrink * shrink for side in frame.shape)
    small = cv2.resize(frame[:height, :width], (width // shrink, height // shrink), interpolation=cv2.INTER_AREA)
    detector = _detector(grid, scale / shrink)
    for picture in _pictures(np.asarray(small), grid, scale / shrink):
        if not 1 <= len(detector.detect(picture)) / len(grid.centres) <= CLUTTER:
            continue
        for method in (0, cv2.CALIB_CB_CLUSTERING):
            complete, points = cv2.findCirclesGrid(
                picture, (grid.columns, grid.rows), flags=cv2.CALIB_CB_SYMMETRIC_GRID | method, blobDetector=detector
            )
            if complete:
                yield (np.asarray(points, dtype=np.float64).reshape(-1, 2) + 0.5) * shrink - 0.5
                break


def _detector(grid: FiducialGrid, scale: float) -> cv2.SimpleBlobDetector:
    params = cv2.SimpleBlobDetector.Params()
    params.blobColor = 255
    params.minArea = float(0.3 * np.pi * (grid.radius * scale) ** 2)
    params.maxArea = float(2.5 * np.pi * (grid.mark_radius * scale) ** 2)
    params.minConvexity = 0.8
    params.minInertiaRatio = 0.4
    params.minDistBetweenBlobs = 0.5 * grid.spacing * scale
    params.minThreshold, params.maxThreshold, params.thresholdStep = 10, 250, 8
    return cv2.SimpleBlobDetector.create(params)


def _pictures(frame: Frame, grid: FiducialGrid, scale: float) -> Iterator[NDArray[np.uint8]]:
    """8-bit versions of a frame, blurred beyond the speckle grain: linear, square root, divided by the local mean."""
    window = int(1.6 * grid.spacing * scale) | 1
    amplitude = np.sqrt(np.clip(frame, 0, None))
    smooth = cv2.GaussianBlur(amplitude, (0, 0), CIRCLE_BLUR * grid.radius * scale)
    mean = cv2.blur(smooth, (window, window))
    linear = cv2.GaussianBlur(frame, (0, 0), CIRCLE_BLUR * grid.radius * scale)
    for picture in (smooth, linear, smooth / (mean + 0.15 * mean.max() + 1e-12)):
        dark, bright = np.percentile(picture, (2, 99.5))
        yield (np.clip((picture - dark) / max(bright - dark, 1e-12), 0, 1) * 255).astype(np.uint8)


def _orient(frame: Frame, points: Array, grid: FiducialGrid) -> Array | None:
    """The points in the order in which the large circles fall on the marks, or None when no order clearly does."""
    lattice = np.arange(len(points)).reshape(grid.rows, grid.columns)
    orders = [lattice, lattice[::-1], lattice[:, ::-1], lattice[::-1, ::-1]]
    if grid.rows == grid.columns:
        orders += [order.T for order in orders]
    to_sensor = np.asarray(cv2.findHomography(grid.centres, points, 0)[0])
    if to_sensor.shape != (3, 3):
        return None  # points on one line have no homography
    sizes = _sizes(frame, to_sensor.astype(np.float64), grid)
    if sizes.std() == 0:
        return None
    scores = np.array([np.corrcoef(sizes[order.ravel()], grid.marks)[0, 1] for order in orders])
    perfect = np.array([np.corrcoef(grid.marks[order.ravel()], grid.marks)[0, 1] for order in orders[1:]])
    best, second = np.argsort(scores)[::-1][:2]
    margin = (scores[best] - scores[second]) / (1 - perfect.max())
    if not (scores[best] > MARK_AGREEMENT and margin > MARK_MARGIN):
        return None
    return np.asarray(points[orders[best].ravel()])


def _sizes(frame: Frame, to_sensor: Array, grid: FiducialGrid) -> Array:
    """Light in the ring that only a mark fills, relative to the light that every circle has in its middle, 0 to 1."""
    reach = int(np.ceil(grid.mark_radius)) + 1
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1].astype(np.float64)
    ring = (np.hypot(x, y) > grid.radius + 1) & (np.hypot(x, y) < grid.mark_radius)
    middle = np.hypot(x, y) < grid.radius - 1
    around = grid.centres[:, None, None, :] + np.stack([x, y], axis=-1)
    where = cv2.perspectiveTransform(around.reshape(1, -1, 2), to_sensor).astype(np.float32)
    where = where.reshape(len(grid.centres), -1, 2)
    patches = cv2.remap(frame, where[..., 0], where[..., 1], cv2.INTER_LINEAR)
    light = patches[:, middle.ravel()].mean(axis=1)
    return np.asarray(np.clip(patches[:, ring.ravel()].mean(axis=1) / np.maximum(light, 1e-12), 0, 1), dtype=np.float64)
