"""A panel and a camera on a simulated bench, as a maker's SDK has them: what ``holoeval new`` writes works on them."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import torch
from numpy.typing import NDArray

from ..display import load_profile
from ..display.simulated.pipeline import SimulatedBench
from ..display.simulated.stages.relay import sample

PANEL, GREEN = (128, 128), 1  # rows and columns; the laser that is on, of the profile's
GAIN, BLACK, NOISE = 5.0, 0.016, 0.0005  # of full scale: for a second of the panel's mean light; without light; rms

_shown = [np.zeros(PANEL, np.uint8)]
_random = np.random.default_rng(0)
_bench = SimulatedBench(load_profile("leto-mild").scaled(PANEL))


def write(levels: NDArray[np.uint8]) -> None:
    """Show levels ``PANEL`` on the panel."""
    _shown[0] = levels.copy()


def grab(seconds: float, bits: int) -> NDArray[np.uint16]:
    """A frame ``(H, W)`` of counts up to ``2**bits - 1``, exposed for so long."""
    share = _light(_shown[0].tobytes()) * GAIN * seconds + BLACK
    noisy = np.clip(share + _random.normal(0, NOISE, share.shape), 0, 1)
    return np.round(noisy * (2**bits - 1)).astype(np.uint16)


@lru_cache(maxsize=8)
def _light(levels: bytes) -> NDArray[np.float64]:
    phase = torch.from_numpy(np.frombuffer(levels, np.uint8).reshape(PANEL) * np.float32(math.tau / 256))
    return sample(_bench.integrated(phase, GREEN), _bench.grid, _bench.image_samples).double().numpy()


_light(_shown[0].tobytes())  # slow the first time, when a camera would seem to hang
