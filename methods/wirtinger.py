"""Wirtinger holography: gradient descent on the phase with the gradient written out.

Chakravarthula, Peng, Kollin, Fuchs & Heide, "Wirtinger holography for near-eye displays", ACM Trans. Graph. 38(6),
213 (2019).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import torch
from annotated_types import Interval
from torch import Tensor

from ..optics import AngularSpectrum
from ..optics.convolution import convolve
from .common import Bench, Offset, nominal_model, per_channel, with_offset
from .descent import Best, cosine_decay
from .initial_phase import InitialPhase, initial_phase
from .losses import LOSSES, Loss, LossName

if TYPE_CHECKING:
    from ..display.api import Region


@dataclass(frozen=True)
class Wirtinger:
    """First-order phase retrieval in the region; light outside it is free.

    iterations: evaluations of loss and gradient, one forward and one adjoint propagation each (the last line search
    of L-BFGS may end a few later).
    loss: see ``losses``. optimiser: Adam, or L-BFGS with a strong Wolfe line search (image by image).
    step: Adam's step [rad], ``constant`` or ``cosine``-decayed to zero (L-BFGS finds its own).
    initial_phase: see ``initial_phase``. offset: global phase offset, see ``common.with_offset``.
    The phase of the least loss that was seen is returned.
    """

    iterations: Annotated[int, Interval(ge=1, le=100_000)] = 200
    loss: LossName = "intensity_l2"
    optimiser: Literal["adam", "lbfgs"] = "adam"
    step: Annotated[float, Interval(gt=0, le=10)] = 0.1
    schedule: Literal["constant", "cosine"] = "constant"
    initial_phase: InitialPhase = "constant"
    offset: Offset = "centre"

    camera: ClassVar[bool] = False
    privileged: ClassVar[bool] = False

    def solve(self, target: Tensor, bench: Bench) -> Tensor:
        """Linear intensity ``(B, C, h, w)`` to phase ``(B, C, H, W)`` [rad]."""
        return per_channel(target, lambda image, channel: self._retrieve(image, bench, channel))

    def _retrieve(self, target: Tensor, bench: Bench, channel: int) -> Tensor:
        model, region = nominal_model(bench, channel, target), bench.spec.region
        start = initial_phase(self.initial_phase, target, bench, channel)
        loss = LOSSES[self.loss]
        if self.optimiser == "adam":
            phase = self._adam(start, Objective(model, region, target, loss))
        else:
            # a line search that is shared would let one image decide the steps of another
            each = [
                self._lbfgs(start[i : i + 1], Objective(model, region, target[i : i + 1], loss))
                for i in range(len(target))
            ]
            phase = torch.cat(each)
        return with_offset(phase, self.offset)

    def _adam(self, start: Tensor, objective: Objective) -> Tensor:
        phase, best = start.clone(), Best(start)
        pixels = phase.shape[-2] * phase.shape[-1]
        optimiser = torch.optim.Adam([phase], lr=self.step, fused=True)
        for iteration in range(self.iterations):
            loss, gradient = objective.evaluate(phase)
            best.update(loss, phase)
            if self._done(loss):
                break
            phase.grad = gradient * pixels  # far above Adam's epsilon, whatever the size of the panel
            if self.schedule == "cosine":
                optimiser.param_groups[0]["lr"] = cosine_decay(self.step, iteration / self.iterations)
            optimiser.step()
        return best.phase

    def _done(self, loss: Tensor) -> bool:
        """Whether losses ``(B,)`` are small enough to stop; here never."""
        return False

    def _lbfgs(self, start: Tensor, objective: Objective) -> Tensor:
        phase, best = start.clone(), Best(start)
        optimiser = torch.optim.LBFGS(
            [phase],
            max_iter=self.iterations,
            max_eval=self.iterations,
            tolerance_grad=0,
            tolerance_change=0,
            history_size=10,
            line_search_fn="strong_wolfe",
        )

        def closure() -> Tensor:
            loss, phase.grad = objective.evaluate(phase)
            best.update(loss, phase)
            return loss.sum()

        optimiser.step(closure)
        return best.phase


@dataclass(frozen=True)
class Objective:
    """A loss of the intensity in the region as a function of the phase; model, target ``(B, h, w)``, loss fixed.

    All have the model's precision.
    """

    model: AngularSpectrum
    region: Region
    target: Tensor
    loss: Loss

    def evaluate(self, phase: Tensor) -> tuple[Tensor, Tensor]:
        """Loss ``(B,)`` and gradient ``(B, H, W)`` at a phase ``(B, H, W)`` [rad].

        For E = P(exp(i phi)) and I = |E|^2, the Wirtinger derivative of L(I) with respect to conj(E) is (dL/dI) E,
        and so dL/dphi = 2 Re(-i exp(-i phi) P*((dL/dI) E)). dL/dI alone is left to autograd.
        """
        height, width = self.model.shape
        if tuple(phase.shape[-2:]) != (height, width):
            raise ValueError(f"phase is {tuple(phase.shape[-2:])}, the propagator was made for {self.model.shape}")
        field = self.model.blank(*phase.shape[:-2])  # padded from the start, if it has to be padded at all
        at_panel = field[..., :height, :width]
        torch.complex(phase.cos(), phase.sin(), out=at_panel)
        image = convolve(field, self.model.transfer)
        at_image = self.region.crop(image)
        loss, slope = self._slope(at_image)
        at_image.mul_(slope)  # in the place of the field: a new array costs as much as the product
        del slope  # the adjoint takes the most memory
        returned = convolve(self.region.clear_around(image), self.model.conjugate)[..., :height, :width]
        return loss, (at_panel.real * returned.imag).addcmul_(at_panel.imag, returned.real, value=-1)

    def _slope(self, at_image: Tensor) -> tuple[Tensor, Tensor]:
        """Loss ``(B,)`` of the field in the region, and 2 dL/dI ``(B, h, w)``."""
        intensity = torch.square(at_image.real).addcmul_(at_image.imag, at_image.imag).requires_grad_()
        loss = self.loss(intensity, self.target)
        (slope,) = torch.autograd.grad(2 * loss.sum(), intensity)
        return loss.detach(), slope
