"""Photographs in which no whole, single, marked fiducial grid is to be found: registration must refuse them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..core.seeds import seed
from ..imaging.grid import MARK_RADIUS, RADIUS, fiducial
from ..imaging.warp import Array, Frame
from .grid_poses import Pose, corner_points, photograph, random_pose, speckle


def impostors(shape: tuple[int, int], number: int) -> Iterator[tuple[str, Frame]]:
    """Name and frame ``(Hs, Ws)`` of every kind of impostor of ``fiducial(shape)``, at random pose ``number``."""
    draw = np.random.default_rng(seed("impostors", shape, number))
    pose = random_pose(number, shape)
    grid = fiducial(shape)
    picture = grid.image.numpy()
    for grain in (1.0, 4.0, 12.0):
        yield f"speckle {grain:g} px wide", speckle(pose.sensor, 1.0, draw, finer=grain)
    y, x = np.indices(shape) // 18
    yield "checkerboard", photograph(pose, ((y + x) % 2).astype(np.float32))
    yield "grid without marks", photograph(pose, _discs(shape, grid.centres, grid.radius))
    yield (
        "grid with its marks shuffled",
        photograph(pose, _discs(shape, grid.centres, _radii(draw.permutation(grid.marks), grid.spacing))),
    )
    yield "finer grid", photograph(pose, _lattice(shape, 0.8))
    for other in _other_shapes(shape):
        yield f"grid of {other[0]}x{other[1]} px", photograph(random_pose(number, other))
    for name, window in _halves(shape):
        half = picture.copy()
        half[window] = 0
        yield f"grid without its {name} half", photograph(pose, half)
    hidden = draw.permutation(np.arange(len(grid.centres)) % 2 == 0)
    radii = np.where(hidden, 0.0, _radii(grid.marks, grid.spacing))
    yield "grid with every second circle hidden", photograph(pose, _discs(shape, grid.centres, radii))
    yield "grid and its mirror image", photograph(pose, (picture + picture[:, ::-1]) / 2)
    yield "grid and itself upside down", photograph(pose, (picture + picture[::-1, ::-1]) / 2)
    yield "two grids a third of a spacing apart", _two(pose, (grid.spacing / 3, 0.0))
    yield "two grids one spacing apart", _two(pose, (grid.spacing, 0.0))


def beyond_the_sensor(pose: Pose, share: float) -> Frame:
    """The photograph of a pose, cropped on one side so that about ``share`` of the region is outside the frame."""
    frame = photograph(pose)
    corners = cv2.perspectiveTransform(corner_points(pose.shape)[None], pose.homography)[0]
    left, right = corners[:, 0].min(), corners[:, 0].max()
    return np.ascontiguousarray(frame[:, round(left + share * (right - left)) :])


def _two(pose: Pose, apart: tuple[float, float]) -> Frame:
    moved = np.eye(3)
    moved[:2, 2] = apart
    other = replace(pose, homography=np.asarray(pose.homography @ moved, dtype=np.float64))
    return np.asarray((photograph(pose) + photograph(other)) / 2, dtype=np.float32)


def _radii(marks: NDArray[np.bool_], spacing: float) -> Array:
    return np.asarray(np.where(marks, MARK_RADIUS, RADIUS) * spacing)


def _discs(shape: tuple[int, int], centres: Array, radii: Array | float) -> Frame:
    y, x = np.mgrid[: shape[0], : shape[1]]
    image = np.zeros(shape)
    for (cx, cy), radius in zip(centres, np.broadcast_to(radii, len(centres)), strict=True):
        if radius > 0:
            image = np.maximum(image, np.clip((radius - np.hypot(x - cx, y - cy)) / 2 + 0.5, 0, 1))
    return np.asarray(image, dtype=np.float32)


def _lattice(shape: tuple[int, int], finer: float) -> Frame:
    """The whole region full of equal circles, ``finer`` times as far apart as the grid's."""
    grid = fiducial(shape)
    step = finer * grid.spacing
    x, y = np.meshgrid(np.arange(step, shape[1] - step / 2, step), np.arange(step, shape[0] - step / 2, step))
    return _discs(shape, np.stack([x, y], axis=-1).reshape(-1, 2), finer * grid.radius)


def _other_shapes(shape: tuple[int, int]) -> list[tuple[int, int]]:
    grid = fiducial(shape)
    shapes = [(160, 160), (192, 256), (130, 130), (128, 208), (256, 256), (96, 96), (shape[1], shape[0])]
    others = [fiducial(other) for other in dict.fromkeys(shapes)]
    return [other.shape for other in others if (other.columns, other.rows) != (grid.columns, grid.rows)]


def _halves(shape: tuple[int, int]) -> list[tuple[str, tuple[slice, slice]]]:
    middle = (shape[0] // 2, shape[1] // 2)
    full = slice(None)
    return [
        ("upper", (slice(None, middle[0]), full)),
        ("lower", (slice(middle[0], None), full)),
        ("left", (full, slice(None, middle[1]))),
        ("right", (full, slice(middle[1], None))),
    ]
