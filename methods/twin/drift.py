"""What a display does while its photographs are taken: the power of its lasers varies, and its picture moves.

Both are learned with the twin and left out of it: a twin is the display as its camera was registered.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import torch
from torch import Tensor

from ...display.api import DisplaySpec
from ..calibrated.approximator import ModelApproximator, Rates
from ..learned.samples import Sample
from .model import TwinCamera, TwinModel

MISFIT = 0.005  # of the light, rms, that a twin errs in the brightness of a capture whose power is known
DIMMEST = 0.01  # of the prediction, below which a capture is not told from a dark one


class TwinApproximator(ModelApproximator):
    """A twin and how it learns from captures of a display that drifts."""

    terms: TwinCamera

    def __init__(self, spec: DisplaySpec, rates: Rates) -> None:
        super().__init__(TwinModel(spec), None, rates, TwinCamera(spec))

    def steadied(self, again: Sequence[Sample]) -> None:
        """Tell how much the power varies, from two or more captures of one hologram."""
        light = torch.stack([sample.capture.mean((-2, -1)) for sample in again])
        self.terms.power.copy_((light / light.mean(0)).var(0).mean().sqrt())

    def step(self, sample: Sample, progress: float) -> dict[str, float]:
        """See the base; the picture is where it was when the sample was captured."""
        with taken(self.terms, sample):
            return super().step(sample, progress)

    def predicted(self, sample: Sample) -> Tensor:
        """See the base; where the picture was then."""
        with taken(self.terms, sample):
            return super().predicted(sample)

    def error(self, predicted: Tensor, capture: Tensor) -> Tensor:
        """See the base. Of another brightness, the share that power is likely to have is no error in the picture; it is
        a small one by itself, whose least sum is at the median of all captures, and so holds the light of the twin."""
        area, power = (-2, -1), self.terms.power
        ratio = (predicted * capture).sum(area, True) / predicted.square().sum(area, True)
        share = power.square() / (power.square() + MISFIT**2)
        apart = ratio.clamp_min(DIMMEST).log().abs().mean()
        own = super().error(predicted * (1 + share * (ratio - 1)), capture)
        return own + share * MISFIT / (power + MISFIT) * apart


@contextmanager
def taken(camera: TwinCamera, sample: Sample) -> Iterator[None]:
    """The camera stands where it stood for a sample."""
    camera.captures = sample.number
    try:
        yield
    finally:
        camera.captures = 0
