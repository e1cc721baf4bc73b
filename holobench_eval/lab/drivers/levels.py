"""The check that every panel makes before it shows anything."""

from __future__ import annotations

import numpy as np

from ...imaging.convention import Levels
from ..devices import DeviceError


def check_levels(name: str, shape: tuple[int, int], levels: Levels) -> None:
    """DeviceError unless ``levels`` are uint8 and as many as the panel ``name`` has pixels: nothing is converted."""
    if levels.dtype != np.uint8 or levels.shape != shape:
        raise DeviceError(f"{name} takes uint8 levels of {shape}, not {levels.dtype} of {levels.shape}")
