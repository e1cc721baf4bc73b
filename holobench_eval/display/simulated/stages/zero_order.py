"""Stage 10: light that the panel reflects without modulation (paper Fig. 4)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Interval


@dataclass(frozen=True)
class ZeroOrder:
    """``fraction`` of the incident power is reflected as it came, with ``phase`` [rad]; the iris may stop it later."""

    fraction: Annotated[float, Interval(ge=0, lt=1)] = 0.0
    phase: float = 0.0

    @property
    def modulated(self) -> float:
        """Amplitude of the modulated light."""
        return math.sqrt(1 - self.fraction)

    @property
    def unmodulated(self) -> complex:
        """Complex amplitude of the unmodulated light."""
        amplitude = math.sqrt(self.fraction)
        return complex(amplitude * math.cos(self.phase), amplitude * math.sin(self.phase))
