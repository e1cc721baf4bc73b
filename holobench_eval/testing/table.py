"""A panel and a camera on a simulated bench, as a maker's SDK has them: what ``holoeval new`` writes works on them."""

from __future__ import annotations

import math

import numpy as np
import torch
from numpy.typing import NDArray

from ..display import load_profile
from ..display.simulated.pipeline import SimulatedBench
from ..display.simulated.stages.relay import sample

PANEL, GREEN = (128, 128), 1  # rows and columns; the laser that is on, of the profile's
GAIN, BLACK, NOISE = 5.0, 0.016, 0.0005  # of full scale: for a second of the panel's mean light; without light; rms

_bench = SimulatedBench(load_profile("leto-mild").scaled(PANEL))
_random = np.random.default_rng(0)
_light = [np.zeros(())]  # on the sensor


def write(levels: NDArray[np.uint8]) -> None:
    """Show levels ``PANEL`` on the panel."""
    phase = torch.from_numpy(levels * np.float32(math.tau / 256))
    _light[0] = sample(_bench.integrated(phase, GREEN), _bench.grid, _bench.image_samples).double().numpy()


def grab(seconds: float, bits: int) -> NDArray[np.uint16]:
    """A frame ``(H, W)`` of counts up to ``2**bits - 1``, exposed for so long."""
    share = _light[0] * GAIN * seconds + BLACK
    noisy = np.clip(share + _random.normal(0, NOISE, share.shape), 0, 1)
    return np.round(noisy * (2**bits - 1)).astype(np.uint16)


write(np.zeros(PANEL, np.uint8))  # slow the first time, when a panel would seem to hang
