"""The look-up table turns a gray level into a phase, not quite the intended one, and flickers (paper Eq. 6)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

import torch
from annotated_types import Interval, Len
from torch import Tensor

from ....optics.phase import TAU
from ..geometry import Geometry
from ..maps import enlarged
from ..stage import Effect, Stage, percent

if TYPE_CHECKING:
    from ..profile import Profile

PerChannel = tuple[float, float, float]


@dataclass(frozen=True)
class LookUpTable(Stage):
    """Phase of a gray level g of L: ``2 pi gain(x, y) (g / L)^gamma``, or a published table.

    gamma: of red, green and blue; of a single colour the first [1]; gain: of the phase, likewise [relative to 2 pi];
    variation: rms of the gain over the panel, smooth [relative]; bend: likewise of gamma [1], as where the cell's
    thickness or temperature changes the table's shape; table: phase of each level [percent of the largest,
    ``(L - 1) / L 2 pi``]; then gamma must be 1.
    """

    title: ClassVar[str] = "look-up table"
    model: ClassVar[str] = "gain(x, y) (g / L)^gamma, or a published table (paper Eq. 6)"

    gamma: PerChannel = (1.0, 1.0, 1.0)
    gain: PerChannel = (1.0, 1.0, 1.0)
    variation: Annotated[float, Interval(ge=0, le=0.5)] = 0.0
    bend: Annotated[float, Interval(ge=0, le=0.3)] = 0.0
    table: Annotated[tuple[float, ...], Len(0, 1024)] = ()

    def effects(self, profile: Profile) -> Iterator[Effect]:
        """Shape and stroke of the table, and how they vary over the panel."""
        count = len(profile.panel.wavelengths)
        given = self.gamma[:count], self.gain[:count]
        if self.table or "table" in self.maps:
            yield Effect("look_up_table", f"a measured look-up table of {2**profile.panel.bits} levels")
        elif set(given[0] + given[1]) != {1.0}:
            powers, gains = ("/".join(f"{value:g}" for value in values) for values in given)
            order = " (R/G/B)" * (count > 1)
            yield Effect("look_up_table", f"look-up table, exponent {powers}, stroke {gains} of a turn{order}")
        if "gain" in self.maps:
            yield Effect("gain_map", "stroke uneven over the panel, as measured")
        if self.variation:
            yield Effect("gain_map", f"stroke uneven over the panel, {percent(self.variation)} rms, smooth")
        if self.bend:
            text = f"exponent of the look-up table uneven over the panel, {self.bend:g} rms, smooth"
            yield Effect("uneven_table", text)

    def gain_map(self, geometry: Geometry) -> Tensor:
        """The gain ``(H, W)`` of the panel for a wavelength: the same path is less phase of a longer one."""
        stroke = self.gain[geometry.channel] * (1 - geometry.detuning / geometry.wavelength)
        if (own := self.map_of("gain", geometry.channel)) is not None:
            return (stroke * enlarged(own, geometry.shape)).float()
        ripple = self.variation * geometry.smooth_map(2.0, "look-up gain")
        return (stroke * (1 + ripple)).float()

    def bend_map(self, geometry: Geometry) -> Tensor | None:
        """What is added to the exponent, ``(H, W)``; None where that is the same all over the panel."""
        return (self.bend * geometry.smooth_map(2.0, "look-up bend")).float() if self.bend else None

    def phase(self, level: Tensor, bits: int, gain: Tensor, channel: int, bend: Tensor | None = None) -> Tensor:
        """Phase [rad] of gray levels ``(..., H, W)``; differentiable in the level. bend: see ``bend_map``."""
        levels = 2**bits
        if self.table or "table" in self.maps:
            return gain * self._tabulated(level, levels, channel)
        fraction = (level / levels).clamp_min(1e-6)
        return gain * TAU * fraction ** (self.gamma[channel] if bend is None else self.gamma[channel] + bend)

    def _tabulated(self, level: Tensor, levels: int, channel: int) -> Tensor:
        table = self.map_of("table", channel)
        if table is None:
            table = torch.tensor(self.table, dtype=torch.float32) / 100 * TAU * (levels - 1) / levels
        if len(table) != levels:
            raise ValueError(f"the table has {len(table)} entries, the panel {levels} levels")
        table = table.to(level.device)
        slope = torch.gradient(table)[0]
        index = level.detach().round().long() % levels
        return table[index] + slope[index] * (level - level.detach())

    def curve(self, bits: int, channel: int) -> Tensor:
        """Phase [rad] of every gray level at the mean gain, for a plot."""
        level = torch.arange(2**bits, dtype=torch.float32)
        own = self.map_of("gain", channel)
        gain = torch.tensor(self.gain[channel]) * (1 if own is None else own.mean())
        return self.phase(level, bits, gain, channel)


@dataclass(frozen=True)
class Flicker(Stage):
    """Relative phase gain noise of a frame, and within it.

    rms: of the gain from frame to frame [share of the 2 pi stroke]; ripple: rms of the gain within a frame, whose light
    the exposure adds up [share of the 2 pi stroke].

    The liquid crystal follows the pulses of a digital addressing and relaxes between refreshes, so that the phase gain
    ripples within each frame and differs a little from one to the next.
    """

    title: ClassVar[str] = "flicker"
    model: ClassVar[str] = "phase gain noise, new in every frame, and a ripple within it"

    rms: Annotated[float, Interval(ge=0, le=0.2)] = 0.0
    ripple: Annotated[float, Interval(ge=0, le=0.2)] = 0.0

    def effects(self, profile: Profile) -> Iterator[Effect]:
        """The noise of the gain, and its ripple."""
        if self.rms:
            yield Effect("flicker", f"flicker, {percent(self.rms)} rms of the stroke from frame to frame")
        if self.ripple:
            yield Effect("ripple", f"ripple within an exposure, {percent(self.ripple)} rms of the stroke")

    @property
    def moments(self) -> tuple[float, ...]:
        """Phase gains within a frame, equal in weight, whose mean light is that of the exposure: the two points of
        Gauss-Hermite quadrature."""
        return (1 - self.ripple, 1 + self.ripple) if self.ripple else (1.0,)

    def gain(self, draw: torch.Generator) -> float:
        """The phase gain of one frame."""
        return 1 + self.rms * float(torch.randn((), generator=draw))
