"""A picture of where registration sees the grid, for a user to look at before believing a score."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from .grid import FiducialGrid
from .register import Registration
from .subpixel import even_picture, offsets
from .warp import Array, Frame, Warp

Colour = tuple[int, int, int]

CIRCLE: Colour = (86, 180, 233)  # red, green, blue; Okabe & Ito's colours, told apart with any colour vision
MARK: Colour = (230, 159, 0)
BORDER: Colour = (240, 228, 66)
BRIGHTEST = 99.5  # percentile of the light that is brightest
GREY = 180  # its level: white would swallow the colours
SMALLEST_PICTURE = 720  # pixels of the picture's shorter side
FRACTION = 4  # bits of a drawn point's position below the pixel


def grid_picture(frame: Frame, grid: FiducialGrid, registration: Registration, channel: int = 0) -> NDArray[np.uint8]:
    """The capture ``(Hs, Ws)`` of one channel of the grid, linear light, as ``(H, W, 3)`` red, green, blue.

    Square root of the light, a light grey at its 99.5th percentile, a whole number of times enlarged where it is small.
    Over it: every circle where the registration puts it, the marks in another colour, the region's border, and at its
    corners their names and the residual [region px, RMS] of the quarter of the circles next to them.
    """
    warp = registration.warps[channel]
    larger = max(1, -(-SMALLEST_PICTURE // min(frame.shape)))
    amplitude = np.sqrt(np.maximum(frame, 0))
    white = max(float(np.percentile(amplitude, BRIGHTEST)), 1e-12)
    grey = np.round(np.clip(amplitude / white, 0, 1) * GREY).astype(np.uint8)
    grey = np.repeat(np.repeat(grey, larger, axis=0), larger, axis=1)
    picture = np.ascontiguousarray(np.stack([grey] * 3, axis=-1))
    around = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    circle = np.stack([np.cos(around), np.sin(around)], axis=1)
    for centre, mark in zip(grid.centres, grid.marks, strict=True):
        outline = warp.to_sensor(centre + circle * (grid.mark_radius if mark else grid.radius))
        _polygon(picture, outline, larger, MARK if mark else CIRCLE)
    _polygon(picture, warp.to_sensor(_outline(grid.shape)), larger, BORDER)
    _label(picture, frame, warp, grid, larger)
    return picture


def _outline(shape: tuple[int, int]) -> Array:
    """Points ``(N, 2)`` along the outer edges of the region's pixels, in order."""
    low, steps = -0.5, np.linspace(0, 1, 32, endpoint=False)
    size = np.array([shape[1], shape[0]], dtype=np.float64)
    turns = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]])
    sides = [a + (b - a) * steps[:, None] for a, b in pairwise(turns)]
    return np.asarray(low + np.concatenate(sides) * size)


def _on_picture(points: Array, larger: int) -> Array:
    return np.asarray((points + 0.5) * larger - 0.5)


def _polygon(picture: NDArray[np.uint8], points: Array, larger: int, colour: Colour) -> None:
    fixed = np.round(_on_picture(points, larger) * 2**FRACTION).astype(np.int32)
    cv2.polylines(picture, [fixed], isClosed=True, color=colour, thickness=2, lineType=cv2.LINE_AA, shift=FRACTION)


def _label(picture: NDArray[np.uint8], frame: Frame, warp: Warp, grid: FiducialGrid, larger: int) -> None:
    """Names of the corners as the target has them, each on a dark plate, pushed inside the picture."""
    distance = np.linalg.norm(offsets(even_picture(frame, warp, grid), grid), axis=1)
    half = np.array([grid.shape[1] - 1.0, grid.shape[0] - 1.0]) / 2
    below, right = grid.centres[:, 1] > half[1], grid.centres[:, 0] > half[0]
    for index, corner in enumerate(_on_picture(warp.corners(), larger)):
        name = ("top left", "top right", "bottom left", "bottom right")[index]
        near = (below == (index >= 2)) & (right == (index % 2 == 1))
        text = f"{name} {np.sqrt(np.mean(distance[near] ** 2)):.2f} px"
        (width, height), drop = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.5, 1)
        x = int(np.clip(corner[0] - width / 2, 2, max(2, picture.shape[1] - width - 3)))
        y = int(np.clip(corner[1] + height / 2, height + 3, max(height + 3, picture.shape[0] - drop - 3)))
        cv2.rectangle(picture, (x - 2, y - height - 2), (x + width + 2, y + drop), (0, 0, 0), cv2.FILLED)
        cv2.putText(picture, text, (x, y), cv2.FONT_HERSHEY_SIMPLEX, 0.5, BORDER, 1, cv2.LINE_AA)
