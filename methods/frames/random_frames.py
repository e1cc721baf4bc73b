"""Frames of random phase, found one by one or together.

Choi, Gopakumar, Peng, Kim, O'Toole & Wetzstein, "Time-multiplexed neural holography: a flexible framework for
holographic near-eye displays with fast heavily-quantized spatial light modulators", ACM SIGGRAPH (2022); Lee, Kim, Lee,
Chen & Lee, "High-contrast, speckle-free, true 3D holography via binary CGH optimization", Sci. Rep. 12, 2811 (2022).
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor

from ...core.errors import UserError
from ...display.api import DisplaySpec
from ...optics.phase import TAU
from ..coarse.levels import Levels
from ..common import Bench, ByColour, nominal_model, unit_field
from ..descent import adam, by_autograd
from ..losses import intensity_l2

Loss = Callable[[Tensor], Tensor]


@dataclass(frozen=True)
class FromRandomFrames(ByColour):
    """Adam on frames that start from random phases of their own; a subclass gives the loss. Where the maker's table
    says which phases the levels of a panel have, each pixel gets the nearest in the end. SI units throughout.

    Parameters
    ----------
    frames : int
        Frames of a hologram, which share one exposure.
    iterations : int
        Evaluations of loss and gradient, of all frames.
    step : float
        Adam's step [rad].
    """

    frames: Annotated[int, Interval(ge=1, le=256)] = 1
    iterations: Annotated[int, Interval(ge=1, le=100_000)] = 200
    step: Annotated[float, Interval(gt=0, le=10)] = 0.1

    version: ClassVar[int] = 2

    def refuse_display(self, spec: DisplaySpec) -> None:
        """UserError for a display that shows fewer frames in an exposure."""
        if self.frames > spec.frames:
            raise UserError(f"frames: {self.frames}; '{spec.name}' shows {spec.frames} at most in an exposure")

    @abstractmethod
    def loss(self, target: Tensor, bench: Bench, channel: int) -> Loss:
        """The loss ``(B F,)`` of phases ``(B F, H, W)`` [rad] for a target ``(B, h, w)``."""

    def retrieve(self, target: Tensor, bench: Bench, channel: int) -> Tensor:
        """The frames of the least loss that was seen."""
        return self.descend(self.loss(target, bench, channel), target, bench, channel)

    def descend(self, loss: Loss, target: Tensor, bench: Bench, channel: int) -> Tensor:
        """`retrieve` for a loss of the frames of every target ``(B, h, w)``."""
        draw = bench.generator("random frames", channel)
        start = TAU * torch.rand((self.frames, *bench.spec.shape), generator=draw, dtype=torch.float64)
        start = start.to(target.device, target.dtype).repeat(len(target), 1, 1)  # the same for all of a batch
        frames = adam(start, by_autograd(loss), self.iterations, self.step)
        if bench.spec.levels:
            levels = Levels(bench.spec, channel, frames)
            frames = levels.shown_by(levels.nearest(frames))
        return frames if self.frames == 1 else frames.unflatten(0, (-1, self.frames))

    def of_scene(self, pictures: Tensor, bench: Bench, loss: Callable[[Tensor, int], Loss]) -> Tensor:
        """A phase ``(C, H, W)``, or of several frames ``(F, C, H, W)`` [rad], for pictures ``(P, C, h, w)`` of a scene.

        loss: that of the pictures ``(P, 1, h, w)`` of a colour.
        """
        colours = enumerate(pictures.unbind(1))
        solved = [self.descend(loss(own[:, None], channel), own[:1], bench, channel) for channel, own in colours]
        return torch.stack(solved, dim=-3)[0]


@dataclass(frozen=True)
class RandomFrames(FromRandomFrames):
    """Adam on frames that start from random phases of their own, for the squared error of intensity in the region.

    A random phase spreads the light of every point of the picture over the whole iris, so that an eye sees the picture
    wherever its pupil is, at the price of speckle. Speckle of independent frames averages out as 1 / sqrt(N); frames
    that are found together can take out each other's. The first frames of more start as fewer frames do. SI units
    throughout.

    Parameters
    ----------
    together : bool
        The loss is that of the frames' mean intensity (true), or each frame has its own (false).
    """

    together: bool = True

    title: ClassVar[str] = "frames of random phase, Choi 2022"

    def loss(self, target: Tensor, bench: Bench, channel: int) -> Loss:
        """The squared error of the mean of all frames, or of each (Choi et al. 2022, Lee et al. 2022)."""
        model, region = nominal_model(bench, channel, target), bench.spec.region
        shared = self.frames if self.together else 1  # frames that a loss is of
        wanted = target.repeat_interleave(self.frames // shared, dim=0)

        def loss(phase: Tensor) -> Tensor:
            light = region.crop(model.forward(unit_field(phase))).abs().square()
            return intensity_l2(light.unflatten(0, (-1, shared)).mean(1), wanted).repeat_interleave(shared)

        return loss
