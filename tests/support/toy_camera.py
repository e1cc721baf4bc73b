"""A display of exact physics and known faults, with a camera that sees noise."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import torch
from torch import Tensor
from torch.nn import functional

from holobench_eval.core import seeds
from holobench_eval.core.errors import BudgetError
from holobench_eval.display.api import Capture, DisplaySpec, Region, white_irradiance
from holobench_eval.display.metered import MeteredDisplay

SPEC = DisplaySpec(
    name="toy",
    shape=(64, 64),
    pitch=6.4e-6,
    wavelengths=(636e-9, 517e-9),
    distance=4e-3,
    bits=8,
    pupil=None,
    region=Region(8, 8, 48, 48),
)


@dataclass
class ToyDisplay:
    """Turns the phase by a smooth ``aberration`` [rad rms] and adds ``unmodulated`` light; ``noise`` beside a white
    pixel's light. frames: captures so far; the noise of each is its own.
    """

    aberration: float = 0.0
    unmodulated: float = 0.0
    noise: float = 0.0
    names: tuple[object, ...] = ()
    frames: int = 0
    spec: DisplaySpec = SPEC

    @property
    def simulation(self) -> ToyDisplay:
        """What a privileged method may differentiate: the display without its noise."""
        return self

    def image(self, phase: Tensor) -> Tensor:
        """What the camera sees without noise, ``(C, h, w)``; incident light is 1."""
        bends = torch.randn(1, len(phase), 5, 5, generator=torch.Generator().manual_seed(3))
        bent = phase + self.aberration * functional.interpolate(bends, self.spec.shape, mode="bicubic")[0]
        fields = [
            self.spec.propagator(colour).forward(torch.polar(torch.ones_like(one), one) + self.unmodulated)
            for colour, one in enumerate(bent)
        ]
        return self.spec.region.crop(torch.stack(fields)).abs().square()

    @property
    def gains(self) -> tuple[float, ...]:
        """No flicker."""
        return (1.0,)

    def expected(self, phase: Tensor, target: Tensor, gain: float = 1.0) -> tuple[Tensor, Tensor]:
        """See ``Simulation``; the noise is beside a white pixel's light."""
        mean = self.image(gain * phase) / white_irradiance(target, self.spec)[:, None, None]
        return mean, torch.full_like(mean, self.noise**2)

    def session(self, names: tuple[object, ...], target: Tensor) -> ToyDisplay:
        return replace(self, names=names, noise=self.noise * white_irradiance(target, self.spec)[:, None, None])

    def announce(self, phases):
        pass

    def capture(self, phase: Tensor) -> Capture:
        draw = seeds.generator("toy", *self.names, self.frames)
        self.frames += 1
        frame = self.image(phase)
        frame = frame + self.noise * torch.randn(frame.shape, generator=draw)
        return Capture(frame, dark=0.0, white=math.inf, gain=(1.0,) * len(frame))

    def rectified(self, capture: Capture, target: Tensor) -> Tensor:
        return capture.linear() / white_irradiance(target, self.spec)[:, None, None]

    def handle(self, method: object, target: Tensor, budget: int | None = None) -> MeteredDisplay:
        name = "x".join(map(str, (len(target), *self.spec.shape)))  # by which `small_training.quick` names its files
        return MeteredDisplay(self, "toy", target, ("item", 0), method, budget, target_name=name)

    def error(self, phase: Tensor, target: Tensor) -> Tensor:
        """Mean squared error ``(C,)`` of the noise-free picture, as it is scored."""
        image = self.image(phase)
        factor = (image * target).sum((1, 2), True) / image.square().sum((1, 2), True)
        return ((factor * image).clamp(0, 1) - target).square().mean((1, 2))

    def scored(self, phase: Tensor, target: Tensor, frames: int = 16) -> Tensor:
        """As ``error``, the mean over pictures with noise that no method has met."""
        camera = self.session(("score",), target)
        pictures = torch.stack([camera.capture(phase).frame for _ in range(frames)])
        factor = (pictures * target).sum((2, 3), True) / pictures.square().sum((2, 3), True)
        return ((factor * pictures).clamp(0, 1) - target).square().mean((0, 2, 3))


class Plug:
    """A handle whose display ends the captures without a warning."""

    def __init__(self, handle: MeteredDisplay, at: int) -> None:
        self._handle, self._at = handle, at

    def __getattr__(self, name: str) -> object:
        return getattr(self._handle, name)

    def announce(self, phases):
        pass

    def capture(self, phase: Tensor) -> Capture:
        if self._handle.captures >= self._at:
            raise BudgetError("plug pulled")
        return self._handle.capture(phase)


def picture(first: int = 0) -> Tensor:
    """Shading and a bright edge, ``(2, 48, 48)`` linear light."""
    draw = torch.rand(1, 2, 6, 6, generator=torch.Generator().manual_seed(20 + first))
    smooth = functional.interpolate(draw, SPEC.region.shape, mode="bilinear")[0]
    smooth[:, :16, :16] = 0.9
    return smooth
