"""Stage 4: a pixel is an aperture; its active area modulates, its dead area does not (paper Eq. 5)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import torch
from annotated_types import Interval
from torch import Tensor

from .crosstalk import sample_positions


@dataclass(frozen=True)
class PixelAperture:
    """Square active area, ``fill`` of the pixel's area; the rest reflects ``dead_amplitude`` without modulation."""

    fill: Annotated[float, Interval(gt=0, le=1)] = 1.0
    dead_amplitude: Annotated[float, Interval(ge=0, le=1)] = 0.0

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
