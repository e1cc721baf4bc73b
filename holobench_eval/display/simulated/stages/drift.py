"""Over days the bench moves away from its calibration (paper 7.2)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor

from ..geometry import Geometry
from ..stage import Effect, Stage
from .coherent_noise import CoherentNoise

if TYPE_CHECKING:
    from ..profile import Profile

LONGEST = 3650  # days of a walk
GATHERED = 365.0  # days in which a panel has gathered the dust that its profile gives it; assumed


@dataclass(frozen=True)
class Drift(Stage):
    """Seeded random walks with daily steps; each rate is the rms change after one day.

    Dust settles besides, a speck at a time, at the rate at which the panel's ``CoherentNoise.specks`` came.

    days: since calibration [days]; power: of the laser [relative, rms after a day]; tilt: of the light [cycles/panel
    height, rms after a day]; gain: of the phase [relative, rms after a day]; pose: shift of the image [panel heights,
    rms after a day].
    """

    title: ClassVar[str] = "drift"
    model: ClassVar[str] = "seeded random walks over days of power, tilt, gain and pose; dust settles (paper 7.2)"

    days: Annotated[float, Interval(ge=0, le=LONGEST)] = 0.0
    power: Annotated[float, Interval(ge=0, le=0.5)] = 0.0
    tilt: Annotated[float, Interval(ge=0, le=10)] = 0.0
    gain: Annotated[float, Interval(ge=0, le=0.5)] = 0.0
    pose: Annotated[float, Interval(ge=0, le=0.1)] = 0.0

    def effects(self, profile: Profile) -> Iterator[Effect]:
        """The days."""
        if self.days:
            yield Effect("drift", f"drift of {self.days:g} days")

    def moved(self, profile: Profile, geometry: Geometry) -> Profile:
        """A profile with the tilt of the beam and the pose of the camera of today."""
        light, relay = profile.illumination, profile.relay
        tilt, shift = (
            [rate * self.walk(geometry, f"{name} {axis}") for axis in "yx"]
            for name, rate in (("tilt", self.tilt), ("pose", self.pose))
        )
        return replace(
            profile,
            illumination=replace(light, tilt=(light.tilt[0] + tilt[0], light.tilt[1] + tilt[1])),
            relay=replace(relay, shift=(relay.shift[0] + shift[0], relay.shift[1] + shift[1])),
        )

    def walk(self, geometry: Geometry, name: str) -> float:
        """Where the walk ``name`` (unit step) stands at ``days``; between two days it goes straight."""
        draw = geometry.generator("drift", name)
        day = math.floor(self.days)
        steps = torch.randn(LONGEST + 1, generator=draw, dtype=torch.float64)  # all of them: one path however far
        return float(steps[:day].sum() + (self.days - day) * steps[day])

    def laser_power(self, geometry: Geometry) -> float:
        """Relative laser power today."""
        return math.exp(self.power * self.walk(geometry, f"power {geometry.channel}"))

    def phase_gain(self, geometry: Geometry) -> float:
        """Relative phase gain of the panel today."""
        return math.exp(self.gain * self.walk(geometry, "gain"))

    def dust(self, geometry: Geometry, noise: CoherentNoise) -> Tensor:
        """Amplitude ``(H, W)`` behind the dust that has settled on the panel since calibration."""
        settled = math.floor(self.days * noise.specks / GATHERED)
        draw = geometry.generator("drift", "dust")
        return noise.shade(geometry, torch.rand(LONGEST, 4, generator=draw, dtype=torch.float64)[:settled])
