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

    width: its standard deviation along a column of pixels [px]; ratio: the standard deviation along a row [of width].

    Fringing fields turn the liquid crystal more along one axis than along the other (Moser et al. 2019, Opt. Express
    27, 25046).
    """

    title: ClassVar[str] = "crosstalk"
    model: ClassVar[str] = (
        "Gaussian convolution of the phase on sub-samples, so that wrap edges become ramps (paper 2.2)"
    )

    width: Annotated[float, Interval(ge=0, le=2)] = 0.0
    ratio: Annotated[float, Interval(ge=0.2, le=5)] = 1.0

    def effects(self, profile: Profile) -> Iterator[Effect]:
        """Its width, and the sub-samples that it acts on."""
        if "width" in self.maps:
            colours = [self.widths(channel) for channel in range(len(profile.panel.wavelengths))]
            widths = ", ".join(f"{down:.3g} x {along:.3g}" for down, along in colours)
            yield Effect("crosstalk", f"measured crosstalk of {widths} px")
            if any(down != along for down, along in colours):
                yield Effect("uneven_crosstalk", "crosstalk of another width along rows than along columns")
        if self.width:
            yield Effect("crosstalk", f"crosstalk of {self.width:g} px")
            if self.ratio != 1:
                yield Effect("uneven_crosstalk", f"crosstalk {self.ratio:g} times as wide along rows as along columns")
        if profile.sampling > 1:
            grid = f"{profile.sampling} x {profile.sampling}"
            yield Effect("sub_pixel_field", f"structure inside a pixel, {grid} samples, each where it is")

    def widths(self, channel: int) -> tuple[float, float]:
        """Standard deviations along a column and along a row of pixels [px]."""
        own = self.map_of("width", channel)
        return (self.width, self.width * self.ratio) if own is None else (float(own[0]), float(own[1]))

    def weights(self, samples: int, channel: int = 0) -> Tensor:
        """``(2, samples, k)``: the share of each neighbour in each sub-sample, along columns and along rows, exact for
        square pixels."""
        widths = self.widths(channel)
        reach = max(1, math.ceil(4 * max(widths)))
        shares = torch.zeros(2, samples, 2 * reach + 1, dtype=torch.float64)
        for axis, width in zip(shares, widths, strict=True):
            for j, position in enumerate(sample_positions(samples)):
                for n in range(-reach, reach + 1):
                    axis[j, n + reach] = _share(n - position, width)
        return (shares / shares.sum(2, keepdim=True)).float()

    def apply(self, phase: Tensor, weights: Tensor) -> Tensor:
        """Phase ``(H, W)`` at pixels to phase ``(samples^2, H, W)`` at sub-samples [rad]."""
        reach, (columns, rows) = weights.shape[2] // 2, weights.tolist()
        padded = F.pad(phase[None, None], (reach, reach, reach, reach), mode="replicate")[0, 0]
        return correlate_each(correlate_each(padded, columns, dim=-2), rows, dim=-1).flatten(0, 1)

    def kernel(self, points: int = 101, channel: int = 0) -> tuple[Tensor, Tensor]:
        """Offsets [pixels] and the share of a pixel at that offset along a column, for a plot."""
        offsets = torch.linspace(-2, 2, points)
        return offsets, torch.tensor([_share(float(offset), self.widths(channel)[0]) for offset in offsets])


def _share(offset: float, width: float) -> float:
    if width == 0:
        return float(abs(offset) < 0.5)
    scale = width * math.sqrt(2)
    return 0.5 * (math.erf((offset + 0.5) / scale) - math.erf((offset - 0.5) / scale))
