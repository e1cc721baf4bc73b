"""Fringing fields smooth the phase across pixels, so that a wrap edge becomes a ramp (paper 2.2)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

import torch
import torch.nn.functional as F  # noqa: N812
from annotated_types import Interval
from torch import Tensor

from ....imaging.shifts import correlate_each
from ..stage import Effect, Stage

if TYPE_CHECKING:
    from ..profile import Profile


def sample_positions(samples: int) -> list[float]:
    """Centres of the sub-samples of a pixel, in pixels from its centre."""
    return [(j - (samples - 1) / 2) / samples for j in range(samples)]


@dataclass(frozen=True)
class Crosstalk(Stage):
    """Convolution of the phase with a Gaussian.

    width: its standard deviation [px].
    """

    title: ClassVar[str] = "crosstalk"
    model: ClassVar[str] = (
        "Gaussian convolution of the phase on sub-samples, so that wrap edges become ramps (paper 2.2)"
    )

    width: Annotated[float, Interval(ge=0, le=2)] = 0.0

    def effects(self, profile: Profile) -> Iterator[Effect]:
        """Its width, and the sub-samples that it acts on."""
        if self.width:
            yield Effect("crosstalk", f"crosstalk of {self.width:g} px")
        if profile.sampling > 1:
            grid = f"{profile.sampling} x {profile.sampling}"
            yield Effect("sub_pixel_field", f"structure inside a pixel, {grid} samples, each where it is")

    def weights(self, samples: int) -> Tensor:
        """``(samples, k)``: the share of each neighbour along one axis in each sub-sample, exact for square pixels."""
        reach = max(1, math.ceil(4 * self.width))
        rows = torch.zeros(samples, 2 * reach + 1, dtype=torch.float64)
        for j, position in enumerate(sample_positions(samples)):
            for n in range(-reach, reach + 1):
                rows[j, n + reach] = self._share(n - position)
        return (rows / rows.sum(1, keepdim=True)).float()

    def _share(self, offset: float) -> float:
        if self.width == 0:
            return float(abs(offset) < 0.5)
        scale = self.width * math.sqrt(2)
        return 0.5 * (math.erf((offset + 0.5) / scale) - math.erf((offset - 0.5) / scale))

    def apply(self, phase: Tensor, weights: Tensor) -> Tensor:
        """Phase ``(H, W)`` at pixels to phase ``(samples^2, H, W)`` at sub-samples [rad]."""
        reach, taps = weights.shape[1] // 2, weights.tolist()
        padded = F.pad(phase[None, None], (reach, reach, reach, reach), mode="replicate")[0, 0]
        return correlate_each(correlate_each(padded, taps, dim=-2), taps, dim=-1).flatten(0, 1)

    def kernel(self, points: int = 101) -> tuple[Tensor, Tensor]:
        """Offsets [pixels] and the share of a pixel at that offset, for a plot."""
        offsets = torch.linspace(-2, 2, points)
        return offsets, torch.tensor([self._share(float(offset)) for offset in offsets])
