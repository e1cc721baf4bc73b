"""The ceiling of a simulated bench: phase retrieval through the bench itself, which no hardware allows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor

from .descent import Best, cosine_decay
from .losses import intensity_l2
from .wirtinger import Wirtinger

if TYPE_CHECKING:
    from ..display.metered import MeteredDisplay


@dataclass(frozen=True)
class Oracle:
    """Adam on the phase for the intensity in the region, differentiated through every stage of the simulated bench.

    It knows all that is fixed about the bench (look-up table, crosstalk, illumination, aberrations) but not the
    noise of a capture. It starts from ``start_iterations`` of Wirtinger, few on purpose: a converged nominal
    phase is full of wraps, and where a panel blurs its wraps, descent does not get out of them again.
    step: Adam's first step [rad], cosine-decayed to zero. The phase of the least loss that was seen is returned,
    per colour.
    """

    iterations: Annotated[int, Interval(ge=1, le=100_000)] = 100
    step: Annotated[float, Interval(gt=0, le=10)] = 0.12
    start_iterations: Annotated[int, Interval(ge=1, le=100_000)] = 5

    camera: ClassVar[bool] = False
    privileged: ClassVar[bool] = True

    def solve(self, target: Tensor, bench: MeteredDisplay) -> Tensor:
        """Linear intensity ``(B, C, h, w)`` to phase ``(B, C, H, W)`` [rad]. CellError without a simulated bench."""
        start = Wirtinger(iterations=self.start_iterations).solve(target, bench)
        return torch.stack([self._refine(image, phase, bench) for image, phase in zip(target, start, strict=True)])

    def _refine(self, target: Tensor, start: Tensor, bench: MeteredDisplay) -> Tensor:
        """One image: target ``(C, h, w)``, start ``(C, H, W)``; the colours do not interact."""
        simulation = bench.simulation
        phase, best = start.clone().requires_grad_(), Best(start)
        pixels = phase.shape[-2] * phase.shape[-1]
        optimiser = torch.optim.Adam([phase], lr=self.step)
        for iteration in range(self.iterations):
            loss = intensity_l2(simulation.image(phase), target)
            best.update(loss, phase)
            # the factor keeps the gradient far above Adam's epsilon
            (phase.grad,) = torch.autograd.grad(pixels * loss.sum(), phase)
            optimiser.param_groups[0]["lr"] = cosine_decay(self.step, iteration / self.iterations)
            optimiser.step()
        return best.phase
