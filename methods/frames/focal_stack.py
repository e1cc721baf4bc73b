"""Frames of random phase that are supervised by a focal stack: sharp where the eye focuses, blurred elsewhere.

Choi, Gopakumar, Peng, Kim, O'Toole & Wetzstein, "Time-multiplexed neural holography: a flexible framework for
holographic near-eye displays with fast heavily-quantized spatial light modulators", ACM SIGGRAPH (2022).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import torch
from torch import Tensor

from ..common import Bench, unit_field
from ..losses import intensity_l2
from .random_frames import FromRandomFrames, Loss


@dataclass(frozen=True)
class FocalStack(FromRandomFrames):
    """Adam on frames that start from random phases, for the squared error of the pictures at all planes of a scene.

    A random phase spreads the light of every point over the iris, so that what is out of focus can blur as it does for
    an eye; a smooth phase keeps it narrow. Each plane is compared after a factor of its own, as it is scored. SI units
    throughout.
    """

    title: ClassVar[str] = "frames of random phase for a focal stack, Choi 2022"
    planes: ClassVar[bool] = True
    fresnel: ClassVar[bool] = True

    def loss(self, target: Tensor, bench: Bench, channel: int) -> Loss:
        """One plane, that of the display."""
        return self._stack_loss(target[None], (0.0,), bench, channel)

    def solve_planes(self, targets: Tensor, offsets: Sequence[float], bench: Bench) -> Tensor:
        """As ``MultiPlane.solve_planes``: phase ``(C, H, W)``, or of several frames ``(F, C, H, W)`` [rad]."""
        return self.of_scene(targets, bench, lambda stack, colour: self._stack_loss(stack, offsets, bench, colour))

    def _stack_loss(self, stack: Tensor, offsets: Sequence[float], bench: Bench, channel: int) -> Loss:
        """The mean squared error of the planes of ``(P, B, h, w)`` (Choi et al. 2022, the loss of focal stacks)."""
        spec, region = bench.spec, bench.spec.region
        kind = torch.complex(stack, stack).dtype
        specs = [replace(spec, distance=spec.distance + offset) for offset in offsets]
        models = [each.propagator(channel, dtype=kind, device=stack.device) for each in specs]

        def loss(phase: Tensor) -> Tensor:
            field = unit_field(phase)
            seen = (
                region.crop(model.forward(field)).abs().square().unflatten(0, (-1, self.frames)).mean(1)
                for model in models
            )
            errors = [intensity_l2(light, wanted) for light, wanted in zip(seen, stack, strict=True)]
            return torch.stack(errors).mean(0).repeat_interleave(self.frames)

        return loss
