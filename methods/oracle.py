"""The ceiling of a simulated bench: phase retrieval through the bench itself, which no hardware allows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor

from ..display.metered import MeteredDisplay
from .descent import adam, by_autograd
from .losses import intensity_l2
from .wirtinger import Wirtinger


@dataclass(frozen=True)
class Oracle:
    """Adam on the phase for the intensity in the region, differentiated through every stage of the simulated bench.

    It knows all that is fixed about the bench (look-up table, crosstalk, illumination, aberrations) but not the
    noise of a capture. It starts from ``start_iterations`` of Wirtinger, few on purpose: a converged nominal
    phase is full of wraps, and where a panel blurs its wraps, descent does not get out of them again. The phase of the
    least loss that was seen is returned, per colour. SI units throughout.

    Parameters
    ----------
    iterations : int
        Evaluations of the loss (Chakravarthula et al. 2020, Eq. 12) and its gradient.
    step : float
        Adam's first step [rad], cosine-decayed to zero.
    start_iterations : int
        Of Wirtinger holography.
    """

    iterations: Annotated[int, Interval(ge=1, le=100_000)] = 100
    step: Annotated[float, Interval(gt=0, le=10)] = 0.12
    start_iterations: Annotated[int, Interval(ge=1, le=100_000)] = 5

    version: ClassVar[int] = 2
    camera: ClassVar[bool] = False
    privileged: ClassVar[bool] = True

    def solve(self, target: Tensor, bench: MeteredDisplay) -> Tensor:
        """Phases of least loss in what the bench itself would capture without noise.

        Parameters
        ----------
        target : Tensor
            Linear intensity ``(B, C, h, w)`` in [0, 1].
        bench : MeteredDisplay
            A simulated display that is open to this method.

        Returns
        -------
        Tensor
            Phase ``(B, C, H, W)`` [rad].

        Raises
        ------
        CellError
            Without a simulated bench.
        """
        start = Wirtinger(iterations=self.start_iterations).solve(target, bench)
        return torch.stack([self._refine(image, phase, bench) for image, phase in zip(target, start, strict=True)])

    def _refine(self, target: Tensor, start: Tensor, bench: MeteredDisplay) -> Tensor:
        """One image: target ``(C, h, w)``, start ``(C, H, W)``; the colours do not interact."""
        simulation = bench.simulation

        def loss(phase: Tensor) -> Tensor:
            return intensity_l2(simulation.image(phase), target)

        return adam(start, by_autograd(loss), self.iterations, self.step, decay=True)
