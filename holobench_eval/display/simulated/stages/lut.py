"""Stage 2: the look-up table turns a gray level into a phase, not quite the intended one (paper Eq. 6)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import torch
from annotated_types import Interval, Len
from torch import Tensor

from ....optics.phase import TAU
from .geometry import Geometry

PerChannel = tuple[float, float, float]
TI_PLM_PERCENT = (0, 1.07, 2.19, 4.50, 5.98, 7.75, 12.06, 18.5, 36.55, 39.55, 45.1, 52.44, 63.93, 71.16, 85.02, 100)


@dataclass(frozen=True)
class LookUpTable:
    """Phase of a gray level g of L: ``2 pi gain(x, y) (g / L)^gamma``, or a published table.

    gamma, gain: per channel (R, G, B); variation: relative rms of the gain over the panel (smooth);
    table: phase of each level in percent of the largest, which is ``(L - 1) / L 2 pi`` (then gamma must be 1).
    """

    gamma: PerChannel = (1.0, 1.0, 1.0)
    gain: PerChannel = (1.0, 1.0, 1.0)
    variation: Annotated[float, Interval(ge=0, le=0.5)] = 0.0
    table: Annotated[tuple[float, ...], Len(0, 1024)] = ()

    def gain_map(self, geometry: Geometry) -> Tensor:
        """The gain ``(H, W)`` of the panel for a channel."""
        ripple = self.variation * geometry.smooth_map(2.0, "look-up gain")
        return (self.gain[geometry.channel] * (1 + ripple)).float()

    def phase(self, level: Tensor, bits: int, gain: Tensor, channel: int) -> Tensor:
        """Phase [rad] of gray levels ``(..., H, W)``; differentiable in the level."""
        levels = 2**bits
        if self.table:
            return gain * self._tabulated(level, levels)
        fraction = (level / levels).clamp_min(1e-6)
        return gain * TAU * fraction ** self.gamma[channel]

    def _tabulated(self, level: Tensor, levels: int) -> Tensor:
        if len(self.table) != levels:
            raise ValueError(f"the table has {len(self.table)} entries, the panel {levels} levels")
        table = torch.tensor(self.table, dtype=torch.float32, device=level.device) / 100 * TAU * (levels - 1) / levels
        slope = torch.gradient(table)[0]
        index = level.detach().round().long() % levels
        return table[index] + slope[index] * (level - level.detach())

    def curve(self, bits: int, channel: int) -> Tensor:
        """Phase [rad] of every gray level at the mean gain, for a plot."""
        level = torch.arange(2**bits, dtype=torch.float32)
        return self.phase(level, bits, torch.tensor(self.gain[channel]), channel)
