"""Descent through the spectrum of a partially coherent source.

Peng, Choi, Kim & Wetzstein, "Speckle-free holography with partially coherent light sources and camera-in-the-loop
calibration", Science Advances 7(46), eabg5040 (2021).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor

from ...display.api import DisplaySpec
from ...optics.phase import blaze, wrap
from ...optics.phasor import squared_modulus
from ..common import Bench, ByColour, unit_field, with_offset
from ..descent import adam, by_autograd
from ..initial_phase import InitialPhase, initial_phase
from ..losses import intensity_l2


def lines(spec: DisplaySpec) -> Iterator[tuple[tuple[float, ...], tuple[float, ...]]]:
    """Offset [m] and share of the power of each line, a colour, by the nominal spectrum of a display."""
    for each in zip(*(spec.spectrum or (((0.0, 1.0),),) * len(spec.wavelengths)), strict=True):
        offsets, shares = zip(*each, strict=True)
        yield offsets, shares


def stroke(wavelength: float, offset: float) -> float:
    """Phase of a panel at a line, as a share of that at the nominal wavelength [m]: the same retardation is a smaller
    part of a longer wave."""
    return wavelength / (wavelength + offset)


@dataclass(frozen=True)
class PartiallyCoherent(ByColour):
    """Adam on the phase for the light of all lines of the source, whose intensities add up; the source is a point.

    Each line meets the panel with a phase in proportion to 1 / wavelength and has a propagation of its own. Where the
    display tells of no spectrum it is a descent at one wavelength. Time grows with the number of lines. SI units
    throughout.

    Parameters
    ----------
    iterations : int
        Evaluations of loss and gradient.
    step : float
        Adam's step [rad].
    initial_phase : str
        Where the descent starts. random: uniform over 2 pi; narrow: uniform over 1 rad; constant: zero; quadratic: the
        lens that gathers the light of the panel in the region; dpe: the double phase hologram. The least populated
        phase is moved to the wrap between 0 and 2 pi, across which the lines other than the nominal one take a step.
    """

    iterations: Annotated[int, Interval(ge=1, le=100_000)] = 200
    step: Annotated[float, Interval(gt=0, le=10)] = 0.1
    initial_phase: InitialPhase = "constant"

    title: ClassVar[str] = "descent through the spectrum, Peng 2021"

    def retrieve(self, target: Tensor, bench: Bench, channel: int) -> Tensor:
        """The phase of the least squared error of intensity that was seen."""

        def loss(phase: Tensor) -> Tensor:
            return intensity_l2(bench.spec.region.crop(intensity(phase, bench.spec, channel)), target)

        start = with_offset(initial_phase(self.initial_phase, target, bench, channel), "centre")
        return adam(start, by_autograd(loss), self.iterations, self.step)


def intensity(phase: Tensor, spec: DisplaySpec, channel: int) -> Tensor:
    """The ideal image ``(B, H, W)`` of a phase ``(B, H, W)`` [rad], all lines of a colour together; differentiable."""
    ramp, total = blaze(spec.shape, spec.blaze).to(phase), torch.zeros_like(phase)
    shown = wrap(phase + ramp)
    for offsets, shares in lines(spec):
        light = unit_field(shown * stroke(spec.wavelengths[channel], offsets[channel]) - ramp)
        model = spec.propagator(channel, light.dtype, phase.device, offsets[channel])
        total = total + shares[channel] * squared_modulus(model.forward(light))
    return total
