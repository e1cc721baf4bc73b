"""Wirtinger holography: gradient descent on the phase with the gradient written out.

Chakravarthula, Peng, Kollin, Fuchs & Heide, "Wirtinger holography for near-eye displays", ACM Trans. Graph. 38(6),
213 (2019); Eq. 11 and 12 of Chakravarthula et al. 2020 are its forward model and its objective.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import torch
from annotated_types import Interval
from torch import Tensor

from ..display.api import Region
from ..optics import Propagator
from .common import Bench, Offset, nominal_model, per_channel, with_offset
from .descent import Best, adam
from .initial_phase import InitialPhase, initial_phase
from .losses import LOSSES, Loss, LossName
from .phase_propagation import PhasePropagation


@dataclass(frozen=True)
class Objective:
    """A loss of the intensity in the region as a function of the phase; model, target ``(B, h, w)``, loss fixed.

    All have the model's precision.
    """

    model: Propagator
    region: Region
    target: Tensor
    loss: Loss

    def evaluate(self, phase: Tensor) -> tuple[Tensor, Tensor]:
        """Loss ``(B,)`` and gradient ``(B, H, W)`` at a phase ``(B, H, W)`` [rad].

        For E = P(exp(i phi)) and ``I = |E|^2``, the Wirtinger derivative of L(I) with respect to conj(E) is (dL/dI) E,
        and so dL/dphi = 2 Re(-i exp(-i phi) P*((dL/dI) E)).
        """
        light = PhasePropagation(self.model, self.region, phase)  # E
        loss = light.weigh(self.loss, self.target)  # L; E becomes 2 (dL/dI) E
        return loss, light.phase_gradient()


@dataclass(frozen=True)
class Wirtinger:
    """Wirtinger holography: gradient descent on the phase, through ideal optics and without a camera.

    It is first-order phase retrieval in the scored region; light outside it is free. The phase of the least loss that
    was seen is returned. SI units throughout.

    Parameters
    ----------
    iterations : int
        Evaluations of loss and gradient, one forward and one adjoint propagation each (the last line search of L-BFGS
        may end a few later).
    loss : str
        Error in the region, at the best brightness and as a share of the target's own size. intensity_l2, amplitude_l2:
        squared, of intensity (Eq. 12 of Chakravarthula et al. 2020) or amplitude; intensity_l1: absolute, of intensity;
        huber: squared up to 0.1 and linear above; ms_ssim: 0.84 (1 - MS-SSIM) and 0.16 of the absolute error.
    optimiser : {"adam", "lbfgs"}
        Adam, or L-BFGS with a strong Wolfe line search (image by image).
    step : float
        Adam's step [rad]; L-BFGS finds its own.
    schedule : {"constant", "cosine"}
        Of Adam's step; "cosine" decays to zero.
    initial_phase : str
        Where the descent starts. random: uniform over 2 pi; narrow: uniform over 1 rad; constant: zero; quadratic: the
        lens that gathers the light of the panel in the region; dpe: the double phase hologram.
    offset : {"none", "centre"}
        Constant phase that is added in the end. none: zero; centre: the one that brings the phase of the fewest pixels
        to the wrap between 0 and 2 pi, whose edges a panel blurs.
    """

    iterations: Annotated[int, Interval(ge=1, le=100_000)] = 200
    loss: LossName = "intensity_l2"
    optimiser: Literal["adam", "lbfgs"] = "adam"
    step: Annotated[float, Interval(gt=0, le=10)] = 0.1
    schedule: Literal["constant", "cosine"] = "constant"
    initial_phase: InitialPhase = "constant"
    offset: Offset = "centre"

    title: ClassVar[str] = "Wirtinger holography"
    tuned: ClassVar[str] = (
        "the starting phase and global offset were chosen on the display ideal and, in part, on an earlier leto-aged, "
        "with photographs that are cropped for the targets of most studies"
    )

    def solve(self, target: Tensor, bench: Bench) -> Tensor:
        """Phases of least loss in the image of the nominal model (Chakravarthula et al. 2020, Eq. 12).

        Parameters
        ----------
        target : Tensor
            Linear intensity ``(B, C, h, w)`` in [0, 1].
        bench : Bench
            Nominal optics in SI units, and named random numbers.

        Returns
        -------
        Tensor
            Phase ``(B, C, H, W)`` [rad].

        Raises
        ------
        UserError
            For a region that is too small for the loss.
        """
        if self.offset != "none":  # one descent serves all offsets
            return with_offset(bench.solved(replace(self, offset="none"), target), self.offset)
        return per_channel(target, lambda image, channel: self._retrieve(image, bench, channel))

    def _retrieve(self, target: Tensor, bench: Bench, channel: int) -> Tensor:
        model, region = nominal_model(bench, channel, target), bench.spec.region
        start = initial_phase(self.initial_phase, target, bench, channel)
        objective = Objective(model, region, target, LOSSES[self.loss])
        if self.optimiser == "adam":
            return self._adam(start, objective)
        # A line search that is shared would let one image decide the steps of another.
        pairs = zip(start.split(1), target.split(1), strict=True)
        return torch.cat([self._lbfgs(begin, replace(objective, target=image)) for begin, image in pairs])

    def _adam(self, start: Tensor, objective: Objective) -> Tensor:
        decay = self.schedule == "cosine"
        return adam(start, objective.evaluate, self.iterations, self.step, decay=decay, done=self._done)

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
