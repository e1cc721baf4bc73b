"""Stage 13: over days the bench moves away from its calibration (paper 7.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import torch
from annotated_types import Interval
from torch import Tensor

from .coherent_noise import CoherentNoise
from .geometry import Geometry

LONGEST = 3650
"""Days of a walk."""
GATHERED = 365.0
"""Days in which a panel has gathered the dust that its profile gives it; assumed."""


@dataclass(frozen=True)
class Drift:
    """Seeded random walks with daily steps; each rate is the rms change after one day.

    Dust settles besides, a speck at a time, at the rate at which the panel's ``CoherentNoise.specks`` came.

    days since calibration; power: relative laser power; tilt [cycles per panel height]; gain: relative phase gain;
    pose: shift of the image [panel heights].
    """

    days: Annotated[float, Interval(ge=0, le=LONGEST)] = 0.0
    power: Annotated[float, Interval(ge=0, le=0.5)] = 0.0
    tilt: Annotated[float, Interval(ge=0, le=10)] = 0.0
    gain: Annotated[float, Interval(ge=0, le=0.5)] = 0.0
    pose: Annotated[float, Interval(ge=0, le=0.1)] = 0.0

    def walk(self, geometry: Geometry, name: str) -> float:
        """Where the walk ``name`` (unit step) stands at ``days``; between two days it goes straight."""
        draw = geometry.generator("drift", name)
        whole = math.floor(self.days)
        steps = torch.randn(LONGEST + 1, generator=draw, dtype=torch.float64)  # all of them: one path however far
        return float(steps[:whole].sum() + (self.days - whole) * steps[whole])

    def laser_power(self, geometry: Geometry) -> float:
        """Relative laser power today."""
        return math.exp(self.power * self.walk(geometry, f"power {geometry.channel}"))

    def phase_gain(self, geometry: Geometry) -> float:
        """Relative phase gain of the panel today."""
        return math.exp(self.gain * self.walk(geometry, "gain"))

    def added_tilt(self, geometry: Geometry) -> tuple[float, float]:
        """Tilt of the beam today [cycles per panel height]."""
        return self.tilt * self.walk(geometry, "tilt y"), self.tilt * self.walk(geometry, "tilt x")

    def dust(self, geometry: Geometry, noise: CoherentNoise) -> Tensor:
        """Amplitude ``(H, W)`` behind the dust that has settled on the panel since calibration."""
        settled = math.floor(self.days * noise.specks / GATHERED)
        draw = geometry.generator("drift", "dust")
        return noise.shade(geometry, torch.rand(LONGEST, 4, generator=draw, dtype=torch.float64)[:settled])

    def added_shift(self, geometry: Geometry) -> tuple[float, float]:
        """Shift of the image on the sensor today [panel heights]."""
        return self.pose * self.walk(geometry, "pose y"), self.pose * self.walk(geometry, "pose x")
