"""Three predictions of a capture, each a special case of the next: what an error budget is made of.

image terms    a few numbers on the ideal intensity: shading, blur, haze and tone (`ImageTerms`)
image network  the same, and a U-Net that sees the ideal intensity and adds to it
field network  the same on the intensity of a field that interferes (`DisplayModel`), and the U-Net sees the field too

Each begins as the ideal image, learns from captures of the same holograms and of dark patterns, and has the squared
error as its loss, since that is what is divided. So a later one can only fail to explain what an earlier one does by
its training.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

from annotated_types import Interval
from torch import Tensor, nn

from ...display.api import DisplaySpec
from ...display.training import TrainingBench
from ..calibrated.approximator import ModelApproximator, Rates
from ..calibrated.display_model import FORM, DisplayModel
from ..calibrated.method import SearchRetrieval, ThroughModel
from ..calibrated.patterns import dark_samples
from ..calibrated.terms import IdealImage, ImageTerms
from ..hil.networks import Network
from ..hil.plus import residual_network
from ..learned.samples import Sample, Schedule, Steps
from ..wirtinger import Wirtinger


class SquaredErrorApproximator(ModelApproximator):
    """`ModelApproximator` by the squared error."""

    LOSS: ClassVar[str] = "l2"

    def error(self, predicted: Tensor, capture: Tensor) -> Tensor:
        """The squared error of a capture ``(C, h, w)``, relative to its power."""
        return (predicted - capture).square().mean() / capture.square().mean()


@dataclass(frozen=True)
class OneRound(Schedule):
    """Captures of the start alone: what is learned is asked about holograms of the same kind."""

    rounds: Annotated[int, Interval(ge=1, le=1)] = 1
    steps: Steps = 1000


@dataclass(frozen=True)
class NestedPrediction(ThroughModel):
    """What the three have in common; the parameters are those of `ThroughModel`.

    `start` makes the holograms that are captured to learn from; in an error budget it should be the study's
    ``holograms``.
    """

    training: OneRound = OneRound()
    search: SearchRetrieval = SearchRetrieval(iterations=0)
    start: Wirtinger = Wirtinger(iterations=50)

    RATES: ClassVar[Rates] = Rates(model=3e-2, network=1e-3)
    version: ClassVar[int] = 2

    def _earlier(self, bench: TrainingBench) -> Sequence[Sample]:
        """Dark patterns are learned from as often as eight images each: natural ones confound haze with tone."""
        return 7 * dark_samples(bench)

    def _network(self, spec: DisplaySpec, inputs: int) -> nn.Module:
        return residual_network(spec, Network(name="unet"), inputs, self.seed, "nested prediction")


@dataclass(frozen=True)
class ImageTermsModel(NestedPrediction):
    """A few numbers on the ideal intensity, learned from captures: shading, blur, haze and tone."""

    title: ClassVar[str] = "image-domain terms"

    def approximator(self, spec: DisplaySpec) -> ModelApproximator:
        """See the base."""
        return SquaredErrorApproximator(IdealImage(spec), None, self.RATES, ImageTerms(spec))


@dataclass(frozen=True)
class ImageNetwork(NestedPrediction):
    """A few numbers on the ideal intensity, and a U-Net that sees it and adds to what they predict."""

    title: ClassVar[str] = "a network of the ideal image"

    def approximator(self, spec: DisplaySpec) -> ModelApproximator:
        """See the base."""
        return SquaredErrorApproximator(IdealImage(spec), self._network(spec, 2), self.RATES, ImageTerms(spec))


@dataclass(frozen=True)
class FieldNetwork(NestedPrediction):
    """A few numbers and a U-Net, both on a field that interferes: that of a physical model of the display."""

    title: ClassVar[str] = "a field model and a network"
    form: ClassVar[frozenset[str]] = FORM

    def approximator(self, spec: DisplaySpec) -> ModelApproximator:
        """See the base."""
        return SquaredErrorApproximator(DisplayModel(spec), self._network(spec, 4), self.RATES, ImageTerms(spec))
