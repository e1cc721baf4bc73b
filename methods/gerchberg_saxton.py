"""Gerchberg-Saxton phase retrieval.

R. W. Gerchberg and W. O. Saxton, "A practical algorithm for the determination of phase from image and
diffraction plane pictures", Optik 35, 237 (1972).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

from annotated_types import Interval
from torch import Tensor

from ..display.api import Region
from ..optics import Propagator
from .common import Bench, ByColour, Offset, nominal_model, unit_field, with_offset
from .initial_phase import InitialPhase, initial_phase


@dataclass(frozen=True)
class GerchbergSaxton(ByColour):
    """Alternate between the target amplitude in the region and unit amplitude at the panel.

    Light outside the region is free: whatever falls there is kept. The target's brightness is set once, so that
    it holds the light which the initial phase sends into the region; were it fitted again in each iteration,
    the error would shrink by moving the light out of the picture. SI units throughout.

    Parameters
    ----------
    iterations : int
        One forward and one adjoint propagation each.
    initial_phase : str
        Where it starts. constant: zero; random: uniform over 2 pi, whose speckle stays; narrow: uniform over 1 rad;
        quadratic: the lens that gathers the light of the panel in the region; dpe: the double phase hologram.
    offset : {"none", "centre"}
        Constant phase that is added in the end. none: zero; centre: the one that brings the phase of the fewest pixels
        to the wrap between 0 and 2 pi, whose edges a panel blurs.
    """

    iterations: Annotated[int, Interval(ge=1, le=100_000)] = 100
    initial_phase: InitialPhase = "constant"
    offset: Offset = "centre"

    title: ClassVar[str] = "Gerchberg-Saxton"
    version: ClassVar[int] = 2

    def retrieve(self, target: Tensor, bench: Bench, channel: int) -> Tensor:
        """The phase after the last iteration, whose error is the least (Gerchberg & Saxton 1972)."""
        model, region = nominal_model(bench, channel, target), bench.spec.region
        phase = initial_phase(self.initial_phase, target, bench, channel)
        amplitude = as_bright(target, phase, model, region)
        for _ in range(self.iterations):
            phase, _ = step(phase, amplitude, model, region)
        return with_offset(phase, self.offset)


def as_bright(target: Tensor, phase: Tensor, model: Propagator, region: Region) -> Tensor:
    """The target's amplitude ``(B, h, w)``, with as much light as ``phase`` sends into the region."""
    light = region.crop(model.forward(unit_field(phase))).abs().square().sum(dim=(-2, -1), keepdim=True)
    return (target.clamp_min(0) * light / target.sum(dim=(-2, -1), keepdim=True).clamp_min(1e-12)).sqrt()


def step(phase: Tensor, amplitude: Tensor, model: Propagator, region: Region) -> tuple[Tensor, Tensor]:
    """One iteration: the new phase, and the squared error ``(B,)`` of the amplitude before it.

    Only the correction inside the region travels back, and is added to the field that is there. This equals
    replacing the amplitude in the region and keeping everything else, also the light that leaves the window or
    stops at the iris and so is not in the image; with it the error can not rise (Fienup, Appl. Opt. 21, 2758 (1982)).
    """
    field = unit_field(phase)
    image = region.crop(model.forward(field))
    correction = amplitude * unit_field(image.angle()) - image
    returned = model.adjoint(region.embed(correction, model.shape))
    return (field + returned).angle(), correction.abs().square().sum(dim=(-2, -1))
