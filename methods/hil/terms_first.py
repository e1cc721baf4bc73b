"""HIL with what happens to any intensity in front of its network: haze, blur, shading and tone by a few numbers.

It departs from Chakravarthula et al. 2020 where retrieval needs more than prediction. A network of small convolutions
learns most of a haze as a tone of the pixel itself, which predicts natural images well and says little of where light
goes. Here a Gaussian over the panel says it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

from annotated_types import Interval

from ...display.api import DisplaySpec
from ...display.training import TrainingBench
from ..calibrated.approximator import ModelApproximator, Rates
from ..calibrated.method import SearchRetrieval, ThroughModel
from ..calibrated.patterns import dark_samples
from ..calibrated.terms import IdealImage, ImageTerms
from ..learned.retrieval import Weight
from ..learned.samples import Sample
from ..wirtinger import Wirtinger
from .networks import Network
from .plus import MostImages, residual_network

RATES = Rates(model=0.0, network=1e-3)  # the ideal image has nothing to learn


@dataclass(frozen=True)
class WithoutCritic(SearchRetrieval):
    """Eq. 22 as in `hil`, but for the verdict of a critic."""

    iterations: Annotated[int, Interval(ge=0, le=100_000)] = 60
    step: Annotated[float, Interval(gt=0, le=10)] = 0.06
    perceptual: Weight = 1.0
    ms_ssim: Weight = 1.0


@dataclass(frozen=True)
class HILTerms(ThroughModel):
    """The loop of `hil` with a few image terms before its network: first what any light meets, then what is left.

    D of Algorithm 1 is the ideal intensity with haze, blur, shading and tone, and a U-Net that sees both and adds to
    the outcome, nothing at first. Of the captures of the first round three are of dark patterns, which alone tell haze
    from tone. U-Net has no normalisation, which would let every pixel depend on the brightness of the entire picture.
    The parameters but for the network are those of all calibrated methods. SI units throughout.

    Parameters
    ----------
    network : Network
        What adds to the outcome of the terms.
    """

    training: MostImages = MostImages()
    retrieval: WithoutCritic = WithoutCritic()
    search: WithoutCritic = WithoutCritic()
    start: Wirtinger = Wirtinger()
    network: Network = Network(name="unet")

    title: ClassVar[str] = "hardware in the loop with image terms"
    version: ClassVar[int] = 1
    form: ClassVar[frozenset[str]] = frozenset({"stray_light"})

    def _earlier(self, bench: TrainingBench) -> Sequence[Sample]:
        """Dark patterns are learned from as often as eight images each: natural ones confound haze with tone."""
        return 7 * dark_samples(bench)

    def approximator(self, spec: DisplaySpec) -> ModelApproximator:
        """The ideal image, next to nothing added."""
        network = residual_network(spec, self.network, 2, self.seed)
        return ModelApproximator(IdealImage(spec), network, RATES, ImageTerms(spec))
