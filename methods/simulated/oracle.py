"""The ceiling of a simulated bench: phase retrieval through the bench itself, which no hardware allows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from ...display.metered import MeteredDisplay
from ..wirtinger import Wirtinger
from .descent import BenchDescent


@dataclass(frozen=True)
class Oracle(BenchDescent):
    """Adam on the phase for the expected score, differentiated through every stage of the simulated bench.

    It knows all that is fixed about the bench (look-up table, crosstalk, illumination, aberrations, registration), and
    how strong the noise of a capture is, but not the noise itself. It descends twice: from ``start_iterations`` of
    Wirtinger, and from the best phase that any other method of the study found for the target on the display. Of all
    phases it has seen, those others included, the one of the best expected score is returned, per colour: no method is
    above it, but for the noise of a capture. SI units throughout.
    """

    title: ClassVar[str] = "descent through the display itself"
    version: ClassVar[int] = 3
    privileged: ClassVar[bool] = True
    follows: ClassVar[bool] = True

    def solve(self, target: Tensor, bench: MeteredDisplay) -> Tensor:
        """Phases of the best expected score.

        Parameters
        ----------
        target : Tensor
            Linear intensity ``(B, C, h, w)`` in [0, 1].
        bench : MeteredDisplay
            A simulated display that is open to this method; its ``starts`` belong to all images of the batch.

        Returns
        -------
        Tensor
            Phase ``(B, C, H, W)`` [rad].

        Raises
        ------
        CellError
            Without a simulated bench.
        """
        own = Wirtinger(iterations=self.start_iterations).solve(target, bench)
        others = [phase.to(target) for phase in bench.starts]
        pairs = zip(target, own, strict=True)
        return torch.stack([self.best(bench.simulation, image, start, others) for image, start in pairs])
