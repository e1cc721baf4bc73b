"""Plug-ins that are trained, for tests of the machinery: a few captures, and nothing that takes time."""

import hashlib
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import torch
from torch import Tensor

LOG = Path(__file__).with_name("rounds.txt")


@dataclass(frozen=True)
class Pictures:
    """A fake dataset of smooth noise."""

    count: int = 2
    seed: int = 0

    def items(self) -> list[str]:
        return [f"picture {i}" for i in range(self.count)]

    def digest(self, item: str) -> str:
        return hashlib.sha256(f"{type(self).__name__} {self.seed} {item}".encode()).hexdigest()

    def load(self, item: str, shape: tuple[int, int], channels: int = 3) -> Tensor:
        draw = torch.Generator().manual_seed(int(self.digest(item)[:8], 16))
        coarse = torch.rand((1, channels, 9, 9), generator=draw)
        return torch.nn.functional.interpolate(coarse, size=shape, mode="bilinear")[0]


@dataclass(frozen=True)
class Unseen(Pictures):
    """Images to train with."""

    count: int = 3
    training: ClassVar[bool] = True


@dataclass(frozen=True)
class Gain:
    """Learns how bright captures are beside ideal images; predicts the ideal image, that much brighter.

    Every round takes one capture and is noted in a file.
    """

    rounds: int = 2
    pause: float = 0.0
    fail: str = ""
    trains: ClassVar[bool] = True
    version: ClassVar[int] = 1

    def prepare(self, bench: Any) -> Mapping[str, Any]:
        seen = [self._round(bench, number) for number in range(self.rounds)]
        if self.fail:
            raise ValueError(self.fail)
        return {"gain": torch.stack([one["gain"] for one in seen]).mean(0), "last": seen[-1]["capture"]}

    def _round(self, bench: Any, number: int) -> dict[str, Any]:
        image = bench.images[number % len(bench.images)]

        def make() -> dict[str, Any]:
            with LOG.open("a") as log:
                log.write(f"{number}\n")
            shape = (len(image.target), *bench.spec.shape)
            phase = 6 * torch.rand(shape, generator=bench.generator("phase", number))
            capture = bench.photograph(phase, image, "round", number)
            time.sleep(self.pause)
            wanted = ideal(phase[None], bench.spec, bench.light(image))[0]
            return {"capture": capture, "gain": capture.mean((1, 2)) / wanted.mean((1, 2))}

        made = bench.kept(f"round {number}", make)
        bench.log(round=number, step=0, gain=float(made["gain"].mean()))
        return dict(made)

    def solve(self, target: Tensor, bench: Any) -> Tensor:
        phase = bench.learned["gain"].view(1, -1, 1, 1)
        return phase.expand(*target.shape[:2], *bench.spec.shape).clone()

    def predict(self, phase: Tensor, bench: Any) -> Tensor:
        return bench.learned["gain"].view(-1, 1, 1) * ideal(phase, bench.spec, bench.light)


def ideal(phase: Tensor, spec: Any, light: Tensor) -> Tensor:
    """Nominal intensity ``(B, C, h, w)`` of a phase ``(B, C, H, W)`` in the unit of captures."""
    fields = [spec.propagator(c).forward(torch.exp(1j * phase[:, c])) for c in range(phase.shape[1])]
    return spec.region.crop(torch.stack(fields, 1).abs().square()) / light.view(-1, 1, 1)


@dataclass(frozen=True)
class Even:
    """Predicts even light, without training."""

    def solve(self, target: Tensor, bench: Any) -> Tensor:
        return torch.zeros(*target.shape[:2], *bench.spec.shape)

    def predict(self, phase: Tensor, bench: Any) -> Tensor:
        return torch.ones(*phase.shape[:2], *bench.spec.region.shape)


@dataclass(frozen=True)
class Blind:
    """Trains and solves, but predicts nothing."""

    trains: ClassVar[bool] = True

    def prepare(self, bench: Any) -> Mapping[str, Any]:
        return {"held out": len(bench.held_out)}

    def solve(self, target: Tensor, bench: Any) -> Tensor:
        return torch.full((*target.shape[:2], *bench.spec.shape), float(bench.learned["held out"]))


@dataclass(frozen=True)
class Capturing:
    """Photographs while it solves."""

    camera: ClassVar[bool] = True

    def solve(self, target: Tensor, bench: Any) -> Tensor:
        phase = torch.zeros(*target.shape[:2], *bench.spec.shape)
        bench.capture(phase[0])
        return phase


@dataclass(frozen=True)
class Peeking:
    """Looks into the simulated bench while it solves."""

    privileged: ClassVar[bool] = True

    def solve(self, target: Tensor, bench: Any) -> Tensor:
        phase = torch.zeros(*target.shape[:2], *bench.spec.shape)
        bench.simulation.expected(phase[0], target[0])
        return phase
