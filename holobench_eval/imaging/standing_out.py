"""Pixels of a camera that stand out from all around them, as no light does."""

from __future__ import annotations

import cv2
import numpy as np

from .similarity import Mask
from .warp import Frame

RING = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], np.uint8)
ALONE = 3.0  # times the spread of its neighbours, by which a pixel stands out: of full speckle one in 500 does
STEP = 0.05  # of the brightest thousandth, by which it does


def hot_and_dead(plane: Frame) -> tuple[Mask, Mask]:
    """Which samples of a plane ``(H, W)`` are brighter, and which darker, than all their neighbours by far."""
    dark, bright = np.percentile(plane, (1, 99.9)).astype(np.float32)
    highest, lowest = cv2.dilate(plane, RING), cv2.erode(plane, RING)
    least = np.maximum(STEP * (bright - dark), ALONE * (highest - lowest))
    return plane - highest > least, lowest - plane > least
