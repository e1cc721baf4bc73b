"""Light that a panel does not modulate: between its active areas (paper Eq. 5), and everywhere (paper Fig. 4)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor

from ..stage import Effect, Stage, percent
from .crosstalk import sample_positions

if TYPE_CHECKING:
    from ..profile import Profile


@dataclass(frozen=True)
class PixelAperture(Stage):
    """Square active area; the rest of the pixel reflects without modulation.

    fill: active area [share of the pixel's]; dead_amplitude: that the rest reflects [relative to the active area's].
    """

    title: ClassVar[str] = "pixel aperture"
    model: ClassVar[str] = (
        "active area modulates, dead area reflects as it is; each sub-sample is a small square (paper Eq. 5)"
    )

    fill: Annotated[float, Interval(gt=0, le=1)] = 1.0
    dead_amplitude: Annotated[float, Interval(ge=0, le=1)] = 0.0

    def effects(self, profile: Profile) -> Iterator[Effect]:
        """The dead area."""
        if self.fill < 1:
            dead = f"{percent(self.fill)} active area, the rest reflects an amplitude of {self.dead_amplitude:g}"
            yield Effect("pixel_aperture", f"pixels of {dead}")

    def active_share(self, samples: int) -> Tensor:
        """Active share of the area of each sub-sample, ``(samples^2, 1, 1)``."""
        half = math.sqrt(self.fill) / 2
        shares = []
        for position in sample_positions(samples):
            low, high = position - 0.5 / samples, position + 0.5 / samples
            shares.append(max(0.0, min(high, half) - max(low, -half)) * samples)
        row = torch.tensor(shares, dtype=torch.float64)
        return torch.outer(row, row).reshape(-1, 1, 1).float()

    def dead_share(self, samples: int) -> Tensor:
        """Amplitude that each sub-sample reflects without modulation, ``(samples^2, 1, 1)``."""
        return (1 - self.active_share(samples)) * self.dead_amplitude


@dataclass(frozen=True)
class ZeroOrder(Stage):
    """Light that is reflected as it came; the iris may stop it later.

    fraction: of it [share of the incident power]; phase: of it [rad].
    """

    title: ClassVar[str] = "zero order"
    model: ClassVar[str] = "unmodulated light, coherent with the image (paper Fig. 4)"

    fraction: Annotated[float, Interval(ge=0, lt=1)] = 0.0
    phase: float = 0.0

    def effects(self, profile: Profile) -> Iterator[Effect]:
        """Its share of the light."""
        if "field" in self.maps:
            shares = ", ".join(percent(abs(light) ** 2) for light in map(complex, *self.maps["field"].T.tolist()))
            yield Effect("zero_order", f"unmodulated light of {shares} of the modulated, as measured")
        if self.fraction:
            yield Effect("zero_order", f"{percent(self.fraction)} of the light unmodulated")

    def amplitudes(self, channel: int) -> tuple[float, complex]:
        """Of the modulated and of the unmodulated light."""
        if (own := self.map_of("field", channel)) is not None:
            return 1.0, complex(*own.tolist())
        amplitude = math.sqrt(self.fraction)
        unmodulated = complex(amplitude * math.cos(self.phase), amplitude * math.sin(self.phase))
        return math.sqrt(1 - self.fraction), unmodulated
