"""Rounding to the levels that the maker's table says a panel has."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from ..common import Bench
from ..wirtinger import Wirtinger
from .levels import Levels


@dataclass(frozen=True)
class NearestLevel:
    """The phases of Wirtinger holography, each pixel on the level of the nearest phase in the maker's table.

    A display puts a phase on the nearest of equal steps. Where the table has others, as that of a micro-mirror panel,
    this is what knowing the table gains. SI units throughout.

    Parameters
    ----------
    start : Wirtinger
        The phases that are rounded.
    """

    start: Wirtinger = Wirtinger()

    title: ClassVar[str] = "Wirtinger holography on the nearest levels"

    def solve(self, target: Tensor, bench: Bench) -> Tensor:
        """Linear intensity ``(B, C, h, w)`` to phases ``(B, C, H, W)`` [rad] that show the nearest levels."""
        colours = enumerate(bench.solved(self.start, target).unbind(1))
        return torch.stack([_rounded(phase, Levels(bench.spec, channel, phase)) for channel, phase in colours], dim=1)


def _rounded(phase: Tensor, levels: Levels) -> Tensor:
    return levels.shown_by(levels.nearest(phase))
