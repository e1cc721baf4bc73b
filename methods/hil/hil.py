"""Learned hardware-in-the-loop phase retrieval.

Chakravarthula, Tseng, Srivastava, Fuchs & Heide, "Learned hardware-in-the-loop phase retrieval for holographic
near-eye displays", ACM Trans. Graph. 39(6), 186 (2020), Section 4.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from torch import Tensor

from ...display.api import DisplaySpec
from ..learned.loop import LearnedLoop
from ..learned.retrieval import Image, PhaseRetrieval, lpips_weights, retrieve
from .approximator import NetworkApproximator
from .approximator_loss import ApproximatorLoss, LearningRates, vgg_weights
from .networks import Network


@dataclass(frozen=True)
class HIL(LearnedLoop[NetworkApproximator]):
    """Phases retrieved through a network that learned, from captures, what the display makes of an ideal image.

    Chakravarthula et al. 2020, Section 4; SI units throughout.

    Parameters
    ----------
    network : Network
        The approximator D (Section 4.3.1) or a baseline of Table 1.
    loss : ApproximatorLoss, optional
        Eq. 20; by default the loss that the network is published with.
    retrieval : PhaseRetrieval
        Of every hologram, through what was learned: Eq. 22. From a converged phase, steps of 0.06 rad gained twice as
        much on captures of dead leaves as steps of 0.0075 rad, which take it as far as the paper's 300 steps of 0.001
        rad.
    rates : LearningRates
        Of Adam, while the approximator learns. Those of the paper are for its 40000 steps.
    """

    network: Network = Network()
    loss: ApproximatorLoss | None = None
    retrieval: PhaseRetrieval = PhaseRetrieval(step=0.06)
    rates: LearningRates = LearningRates(generator=1e-3, discriminator=5e-5, decay=True)

    title: ClassVar[str] = "hardware in the loop, Chakravarthula 2020"
    tuned: ClassVar[str] = (
        "the network (a quarter of the paper's filters, 1,300 steps for 40,000), rates and steps were chosen on a "
        "trial display that resembles leto-hazy, with generated images"
    )
    version: ClassVar[int] = 4

    def external(self) -> dict[str, Path | None]:
        """Files that it takes where a machine has them, by what they hold; None for one that is not there."""
        return {**lpips_weights(self.retrieval), **vgg_weights(self.network, self.loss)}

    def approximator(self, spec: DisplaySpec) -> NetworkApproximator:
        """D, untrained."""
        with_critic = self.retrieval.adversarial > 0
        return NetworkApproximator(spec, self.network, self.loss, with_critic, self.seed, rates=self.rates)

    def _retrieve(self, approximator: NetworkApproximator, display: Image, target: Tensor, start: Tensor) -> Tensor:
        return retrieve(display, target, start, self.retrieval, approximator.verdict)
