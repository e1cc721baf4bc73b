"""One hologram for several planes: phase retrieval of all planes of a focal stack at once.

The way to depth that Chakravarthula et al. 2020 (Section 7.1) name beside their own: the volume is cut into planes, and
the hologram of all of them is optimised jointly, which takes as many times longer as there are planes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor

from .common import Bench, Offset, per_channel, with_offset
from .descent import adam
from .initial_phase import InitialPhase, initial_phase
from .losses import LOSSES, LossName
from .wirtinger import Objective


@dataclass(frozen=True)
class MultiPlane:
    """Adam on one phase for the mean loss of the intensities at all planes, by Wirtinger's gradient at each.

    Each plane is compared after an intensity scale of its own, as it is scored. The phase of the least loss that was
    seen is returned. Chakravarthula et al. 2020, Section 7.1; SI units throughout.

    Parameters
    ----------
    iterations : int
        Evaluations of the loss, with one forward and one adjoint propagation a plane.
    loss : str
        Error in the region, at the best brightness and as a share of the target's own size. intensity_l2, amplitude_l2:
        squared, of intensity (Eq. 12 of Chakravarthula et al. 2020) or amplitude; intensity_l1: absolute, of intensity;
        huber: squared up to 0.1 and linear above; ms_ssim: 0.84 (1 - MS-SSIM) and 0.16 of the absolute error.
    step : float
        Adam's step [rad].
    initial_phase : str
        Where the descent starts. random: uniform over 2 pi; narrow: uniform over 1 rad; constant: zero; quadratic: the
        lens that gathers the light of the panel in the region; dpe: the double phase hologram, both of the first plane.
    offset : {"none", "centre"}
        Constant phase that is added in the end. none: zero; centre: the one that brings the phase of the fewest pixels
        to the wrap between 0 and 2 pi, whose edges a panel blurs.
    """

    iterations: Annotated[int, Interval(ge=1, le=100_000)] = 200
    loss: LossName = "intensity_l2"
    step: Annotated[float, Interval(gt=0, le=10)] = 0.1
    initial_phase: InitialPhase = "constant"
    offset: Offset = "centre"

    title: ClassVar[str] = "descent for all planes"
    version: ClassVar[int] = 2
    planes: ClassVar[bool] = True
    fresnel: ClassVar[bool] = True

    def solve(self, target: Tensor, bench: Bench) -> Tensor:
        """One plane, that of the display: linear intensity ``(B, C, h, w)`` to phase ``(B, C, H, W)`` [rad]."""
        return per_channel(target, lambda image, channel: self._retrieve(image[None], [0.0], bench, channel))

    def solve_planes(self, targets: Tensor, offsets: Sequence[float], bench: Bench) -> Tensor:
        """One hologram for several planes.

        Parameters
        ----------
        targets : Tensor
            Linear intensities ``(P, C, h, w)`` in [0, 1].
        offsets : sequence of float
            Distances of the planes from that of the display [m]; positive ones are farther from the panel.
        bench : Bench
            Nominal optics in SI units, and named random numbers.

        Returns
        -------
        Tensor
            Phase ``(C, H, W)`` [rad].
        """
        colours = range(targets.shape[1])
        return torch.cat([self._retrieve(targets[:, None, colour], offsets, bench, colour) for colour in colours])

    def _retrieve(self, targets: Tensor, offsets: Sequence[float], bench: Bench, channel: int) -> Tensor:
        """Targets ``(P, B, h, w)`` of a colour to phases ``(B, H, W)``."""
        planes = [self._objective(*plane, bench, channel) for plane in zip(targets, offsets, strict=True)]
        start = initial_phase(self.initial_phase, targets[0], bench, channel)

        def evaluate(phase: Tensor) -> tuple[Tensor, Tensor]:
            losses, gradients = zip(*(plane.evaluate(phase) for plane in planes), strict=True)
            return torch.stack(losses).mean(0), torch.stack(gradients).mean(0)

        return with_offset(adam(start, evaluate, self.iterations, self.step), self.offset)

    def _objective(self, target: Tensor, offset: float, bench: Bench, channel: int) -> Objective:
        """The loss at one plane, through the nominal model at its distance."""
        spec = replace(bench.spec, distance=bench.spec.distance + offset)
        model = spec.propagator(channel, dtype=torch.complex(target, target).dtype, device=target.device)
        return Objective(model, spec.region, target, LOSSES[self.loss])
