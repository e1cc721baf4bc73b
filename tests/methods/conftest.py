from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import pytest
import torch
from torch import Tensor

from holobench_eval.core import seeds
from holobench_eval.display.api import DisplaySpec, Region, white_irradiance
from holobench_eval.display.nominal import ideal_image


@dataclass
class BentSimulation:
    """A display with a bent look-up table, as a differentiable stand-in for the simulated bench."""

    spec: DisplaySpec
    seen: list[Tensor] = field(default_factory=list)

    def image(self, phase: Tensor) -> Tensor:
        return ideal_image(phase + 0.5 * torch.sin(phase), self.spec)

    @property
    def gains(self) -> tuple[float, ...]:
        return (1.0,)

    def expected(self, phase: Tensor, target: Tensor, gain: float = 1.0) -> tuple[Tensor, Tensor]:
        mean = self.image(gain * phase) / white_irradiance(target, self.spec)[:, None, None]
        return mean, torch.zeros_like(mean)


@dataclass
class FakeBench:
    """What a method sees of a bench: nominal optics, named random numbers, and for the oracle the bench itself."""

    spec: DisplaySpec
    cell: str = "cell"
    starts: tuple[Tensor, ...] = ()

    def generator(self, *names: object) -> torch.Generator:
        return seeds.generator(self.cell, *names)

    def solved(self, method: Any, target: Tensor) -> Tensor:
        return method.solve(target, self)

    @property
    def simulation(self) -> BentSimulation:
        return BentSimulation(self.spec)


@pytest.fixture
def make_bench() -> Callable[..., FakeBench]:
    def make(size: int = 64, region: int = 48, pupil: float | None = None, distance: float = 4e-3) -> FakeBench:
        edge = (size - region) // 2
        return FakeBench(
            DisplaySpec(
                name="fake",
                shape=(size, size + 8),
                pitch=6.4e-6,
                wavelengths=(636e-9, 517e-9, 446e-9),
                distance=distance,
                bits=8,
                pupil=pupil,
                region=Region(edge, edge + 4, region, region),
            )
        )

    return make


@pytest.fixture
def bench(make_bench: Callable[..., FakeBench]) -> FakeBench:
    return make_bench()


@pytest.fixture
def scene() -> Callable[..., Tensor]:
    """Pictures with shading, edges and dark parts, ``(batch, channels, size, size)`` linear light."""

    def make(size: int = 48, batch: int = 1, channels: int = 1, dtype: torch.dtype = torch.float32) -> Tensor:
        draw = torch.Generator().manual_seed(7)
        y, x = torch.meshgrid(torch.linspace(-1, 1, size), torch.linspace(-1, 1, size), indexing="ij")
        pictures = torch.empty(batch, channels, size, size)
        for picture in pictures.flatten(0, 1):
            picture.copy_(0.35 + 0.2 * torch.sin(3 * x + 2 * y))
            for cx, cy, radius, value in torch.rand(12, 4, generator=draw).tolist():
                disc = (x - 2 * cx + 1) ** 2 + (y - 2 * cy + 1) ** 2 < (0.1 + 0.3 * radius) ** 2
                picture[disc] = value
        return pictures.to(dtype)

    return make


@pytest.fixture
def linear_psnr() -> Callable[[Tensor, Tensor, FakeBench], float]:
    """PSNR [dB] of the ideal image in the region, one least-squares factor per channel, clipped."""

    def measure(phase: Tensor, target: Tensor, bench: FakeBench) -> float:
        errors = []
        for channel in range(target.shape[1]):
            model = bench.spec.propagator(channel)
            light = model.forward(torch.polar(torch.ones_like(phase[:, channel]), phase[:, channel]))
            intensity, wanted = bench.spec.region.crop(light).abs().square(), target[:, channel]
            scale = (intensity * wanted).sum((1, 2), True) / intensity.square().sum((1, 2), True)
            errors.append(((scale * intensity).clamp(0, 1) - wanted).square().mean())
        return float(-10 * torch.log10(torch.stack(errors).mean()))

    return measure
