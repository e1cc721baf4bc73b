"""Dust, scratches and rough surfaces, at the panel and on a plane before the image (paper Eq. 9)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

import torch
import torch.nn.functional as F  # noqa: N812
from annotated_types import Interval
from torch import Tensor

from ..geometry import Geometry
from ..stage import Effect, Stage, percent

if TYPE_CHECKING:
    from ..profile import Profile


@dataclass(frozen=True)
class CoherentNoise(Stage):
    """Complex transmission of dirt. Sizes in panel heights.

    specks, scratches: how many at the panel [count]; speck_radius: largest radius [panel heights]; roughness: rms phase
    of the panel's surface [rad]; roughness_pixels: over which it is correlated [px]; plane_specks: how many on a plane
    before the image, where they cast rings [count]; plane_distance: of that plane from the image [share of the
    distance].
    """

    title: ClassVar[str] = "coherent noise"
    model: ClassVar[str] = "dust, scratches and roughness at the panel (paper Eq. 9)"

    specks: Annotated[int, Interval(ge=0, le=10000)] = 0
    scratches: Annotated[int, Interval(ge=0, le=1000)] = 0
    speck_radius: Annotated[float, Interval(gt=0, le=0.2)] = 0.01
    roughness: Annotated[float, Interval(ge=0, le=2)] = 0.0
    roughness_pixels: Annotated[float, Interval(gt=0, le=100)] = 3.0
    plane_specks: Annotated[int, Interval(ge=0, le=10000)] = 0
    plane_distance: Annotated[float, Interval(gt=0, lt=1)] = 0.15

    def effects(self, profile: Profile) -> Iterator[Effect]:
        """Dirt at the panel; that of the other plane is met later, see ``DustPlane``."""
        if self.specks or self.scratches:
            yield Effect("panel_dust", f"dust at the panel, {self.specks} specks and {self.scratches} scratches")
        if self.roughness:
            size = f"{self.roughness:g} rad rms over {self.roughness_pixels:g} px"
            yield Effect("roughness", f"rough surface of the panel, {size}")

    def panel(self, geometry: Geometry) -> Tensor:
        """Complex transmission ``(H, W)`` at the panel."""
        amplitude = self._specks(geometry, self.specks, "panel") * self._scratches(geometry)
        phase = self.roughness * self._rough(geometry)
        return torch.polar(amplitude, phase).to(torch.complex64)

    def plane(self, geometry: Geometry) -> Tensor | None:
        """Transmission ``(H, W)`` of the plane before the image; None when it is clean."""
        if self.plane_specks == 0:
            return None
        return self._specks(geometry, self.plane_specks, "plane").to(torch.complex64)

    def _specks(self, geometry: Geometry, count: int, where: str) -> Tensor:
        draws = torch.rand(count, 4, generator=geometry.generator("specks", where), dtype=torch.float64)
        return self.shade(geometry, draws)

    def shade(self, geometry: Geometry, draws: Tensor) -> Tensor:
        """Amplitude ``(H, W)`` behind absorbing discs with soft edges, of which each has four random numbers in [0, 1]:
        row, column, radius (from a power law, many small and few large) and depth. ``(n, 4)``."""
        height, width = geometry.shape
        y, x = geometry.coordinates()
        amplitude = torch.ones(geometry.shape, dtype=torch.float64)
        for row, column, size, depth in draws.tolist():
            radius = max(self.speck_radius * (0.15 + 0.85 * size**3), 0.75 / height)
            distance = torch.sqrt((y - row + 0.5) ** 2 + (x - (column - 0.5) * width / height) ** 2)
            shade = ((radius - distance) * height + 0.5).clamp(0, 1)
            amplitude *= 1 - (0.4 + 0.6 * depth) * shade
        return amplitude

    def _scratches(self, geometry: Geometry) -> Tensor:
        height, width = geometry.shape
        y, x = geometry.coordinates()
        amplitude = torch.ones(geometry.shape, dtype=torch.float64)
        draws = torch.rand(self.scratches, 4, generator=geometry.generator("scratches"), dtype=torch.float64)
        for row, column, turn, length in draws.tolist():
            angle = math.pi * turn
            dy, dx = y - row + 0.5, x - (column - 0.5) * width / height
            along = dx * math.cos(angle) + dy * math.sin(angle)
            across = -dx * math.sin(angle) + dy * math.cos(angle)
            line = (1 - (across * height).abs()).clamp(0, 1) * (along.abs() < 0.05 + 0.25 * length)
            amplitude *= 1 - 0.7 * line
        return amplitude

    def _rough(self, geometry: Geometry) -> Tensor:
        white = torch.randn(geometry.shape, generator=geometry.generator("roughness"), dtype=torch.float64)
        if self.roughness == 0:
            return torch.zeros_like(white)
        reach = math.ceil(3 * self.roughness_pixels)
        taps = torch.exp(-0.5 * (torch.arange(-reach, reach + 1, dtype=torch.float64) / self.roughness_pixels) ** 2)
        padded = F.pad(white[None, None], (reach, reach, reach, reach), mode="reflect")
        smooth = F.conv2d(F.conv2d(padded, taps.view(1, 1, -1, 1)), taps.view(1, 1, 1, -1))[0, 0]
        return smooth / smooth.pow(2).mean().sqrt()


@dataclass(frozen=True)
class DustPlane(Stage):
    """``CoherentNoise.plane``, where light meets it; its parameters are those of ``CoherentNoise``."""

    title: ClassVar[str] = "dust plane"
    model: ClassVar[str] = "dust on a plane before the image, which casts rings (paper Eq. 9)"

    def effects(self, profile: Profile) -> Iterator[Effect]:
        """The specks and their plane."""
        dirt = profile.coherent_noise
        if dirt.plane_specks:
            plane = f"{percent(dirt.plane_distance)} of the way before the image"
            yield Effect("plane_dust", f"dust on an intermediate plane, {dirt.plane_specks} specks {plane}")
