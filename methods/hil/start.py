"""Wirtinger holography stopped while its phase is still smooth: where ``hil_tuned`` starts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import torch
from annotated_types import Interval
from torch import Tensor

from ...core.errors import UserError
from ..common import Bench
from ..wirtinger import Wirtinger


@dataclass(frozen=True)
class SmoothStart(Wirtinger):
    """Wirtinger holography that stops, colour by colour, at a given error of the ideal picture.

    On the way to convergence a phase fills with wraps, which a display with crosstalk and a look-up table of its own
    spoils, so that the last digits of the ideal picture cost more in the captured one than they bring. How many
    iterations a picture can do without depends on it: a bright, busy one few, a dark one with a few lights many, and
    what is left there is light where none should be. Hence a tolerance, as in the discrepancy principle of iterative
    regularisation (Morozov 1966), in place of a number of iterations.

    Not in the paper. The other parameters are those of `Wirtinger`.

    Parameters
    ----------
    tolerance : float
        Squared error of the intensity over the target's squared intensity; 0: all iterations are made.
    constant : float
        Phase [rad] that is added in the end.
    """

    tolerance: Annotated[float, Interval(ge=0, le=1)] = 0.0
    constant: float = 0.0

    def __post_init__(self) -> None:
        if self.tolerance and (self.optimiser, self.loss) != ("adam", "intensity_l2"):
            raise UserError(
                "start: a tolerance is of the loss intensity_l2 and needs the optimiser adam; or set it to 0"
            )

    def solve(self, target: Tensor, bench: Bench) -> Tensor:
        """Linear intensity ``(B, C, h, w)`` to phase ``(B, C, H, W)`` [rad]; each image has its own last iteration."""
        descent = replace(self, constant=0.0)
        return torch.cat([Wirtinger.solve(descent, image[None], bench) for image in target]) + self.constant

    def _done(self, loss: Tensor) -> bool:
        return self.tolerance > 0 and bool((loss <= self.tolerance).all())
