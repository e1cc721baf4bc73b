"""Stage 5: the liquid crystal relaxes between refreshes, so that each frame has a slightly other phase gain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import torch
from annotated_types import Interval


@dataclass(frozen=True)
class Flicker:
    """Relative phase gain noise of a frame; ``rms`` of the 2 pi stroke."""

    rms: Annotated[float, Interval(ge=0, le=0.2)] = 0.0

    def gain(self, draw: torch.Generator) -> float:
        """The phase gain of one frame."""
        return 1 + self.rms * float(torch.randn((), generator=draw))
