"""Hybrid input-output phase retrieval, for a phase-only panel.

J. R. Fienup, "Phase retrieval algorithms: a comparison", Appl. Opt. 21, 2758 (1982); the input-output
idea was made for computer-generated holograms in J. R. Fienup, Opt. Eng. 19, 297 (1980).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor

from .common import Bench, ByColour, Offset, nominal_model, unit_field, with_offset
from .gerchberg_saxton import as_bright
from .initial_phase import InitialPhase, initial_phase


@dataclass(frozen=True)
class HybridInputOutput(ByColour):
    """Hybrid input-output (Fienup 1982): the panel is driven with an input image that over-corrects the target.

    Fienup's two planes map as follows. The Fourier modulus, which is known exactly, is the unit amplitude of
    the panel. The object constraint is the target amplitude in the region. Where the output violates it
    (inside the region) the next input is the last input plus ``beta`` times the change wanted; where nothing is
    wanted (outside) the next input is the output. The error is not monotone, so the best phase is returned. SI units
    throughout.

    Parameters
    ----------
    iterations : int
        One forward and one adjoint propagation each.
    beta : float
        Gain of the feedback (Fienup 1982).
    initial_phase : str
        Where it starts. random: uniform over 2 pi; narrow: uniform over 1 rad; constant: zero; quadratic: the
        lens that gathers the light of the panel in the region; dpe: the double phase hologram.
    offset : {"none", "centre"}
        Constant phase that is added in the end. none: zero; centre: the one that brings the phase of the fewest pixels
        to the wrap between 0 and 2 pi, whose edges a panel blurs.
    """

    iterations: Annotated[int, Interval(ge=1, le=100_000)] = 100
    beta: Annotated[float, Interval(gt=0, le=2)] = 0.9
    initial_phase: InitialPhase = "random"
    offset: Offset = "centre"

    title: ClassVar[str] = "hybrid input-output"
    version: ClassVar[int] = 2

    def retrieve(self, target: Tensor, bench: Bench, channel: int) -> Tensor:
        """The phase of the least error of amplitude that was seen (Fienup 1982)."""
        model, region = nominal_model(bench, channel, target), bench.spec.region
        phase = initial_phase(self.initial_phase, target, bench, channel)
        amplitude = as_bright(target, phase, model, region)
        driving = region.crop(model.forward(unit_field(phase)))
        best, least = phase, target.new_full((target.shape[0],), torch.inf)
        for _ in range(self.iterations):
            field = unit_field(phase)
            output = region.crop(model.forward(field))
            wanted = amplitude * unit_field(output.angle()) - output
            error = wanted.abs().square().sum(dim=(-2, -1))
            best = torch.where((error < least)[:, None, None], phase, best)
            least = torch.minimum(error, least)
            driving = driving + self.beta * wanted
            returned = model.adjoint(region.embed(driving - output, model.shape))
            phase = (field + returned).angle()
        return with_offset(best, self.offset)
