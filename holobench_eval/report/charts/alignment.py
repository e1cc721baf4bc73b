"""A picture of an alignment: the target's outline on the capture, and capture and target in a checkerboard."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ...imaging.warp import Warp
from .look import save_picture

HEIGHT = 480  # pixels
SQUARES = 8
YELLOW = (0, 255, 255)  # blue first
BLACK = (0, 0, 0)

Values = NDArray[np.float32]


def draw_alignment(path: Path, capture: Values, warp: Warp, matched: Values, target: Values) -> None:
    """Draw a capture ``(C, Hs, Ws)`` with the outline of its target, and a checkerboard of the target ``(C, h, w)`` and
    the capture on its pixels, ``matched`` ``(C, h, w)``; display-encoded values in [0, 1]."""
    scale = HEIGHT / capture.shape[1]
    left = _levels(capture, (round(capture.shape[2] * scale), HEIGHT))
    height, width = warp.shape
    ends = np.array([[-0.5, -0.5], [width - 0.5, -0.5], [width - 0.5, height - 0.5], [-0.5, height - 0.5]])
    # Drawn in sixteenths of a pixel.
    corners = np.round(((warp.to_sensor(ends) + 0.5) * scale - 0.5) * 16).astype(np.int32)
    for colour, thick in ((BLACK, 5), (YELLOW, 2)):
        cv2.polylines(left, [corners.reshape(-1, 1, 2)], True, colour, thick, cv2.LINE_AA, 4)
        cv2.circle(left, [int(value) for value in corners[0]], 16 * (3 + thick), colour, -1, cv2.LINE_AA, 4)
    row, column = np.arange(height)[:, None] * SQUARES // height, np.arange(width) * SQUARES // width
    board = np.where((row + column) % 2 == 0, target, matched)
    right = _levels(np.asarray(board, dtype=np.float32), (round(width * HEIGHT / height), HEIGHT))
    gap = np.full((HEIGHT, 12, 3), 255, dtype=np.uint8)
    save_picture(np.ascontiguousarray(np.hstack([left, gap, right])[..., ::-1]), path)


def _levels(picture: Values, size: tuple[int, int]) -> NDArray[np.uint8]:
    """``(h, w, 3)`` levels, blue first, of ``(C, h, w)`` values at a size (columns, rows)."""
    colour = np.broadcast_to(picture, (3, *picture.shape[1:]))[::-1].transpose(1, 2, 0)
    shrunk = cv2.resize(np.ascontiguousarray(colour), size, interpolation=cv2.INTER_AREA)
    return np.ascontiguousarray(np.clip(shrunk * 255 + 0.5, 0, 255).astype(np.uint8))
