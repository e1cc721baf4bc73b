"""The hardware-in-the-loop baseline of Neural 3D Holography: an amplitude U-Net trained with an L1 loss.

Choi, Gopakumar, Peng, Kim & Wetzstein, "Neural 3D holography: learning accurate wave propagation models for 3D
holographic virtual and augmented reality displays", ACM Trans. Graph. 40(6), 240 (2021), compare with a model of this
form under the name of Chakravarthula et al. 2020. It is not that paper's network, hence a name of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from torch import Tensor

from ...display.api import DisplaySpec
from ...display.training import TrainingBench
from ..learned.loop import LearnedLoop
from ..learned.retrieval import Image, SquaredErrorRetrieval, lpips_weights, retrieve
from ..learned.samples import Schedule
from ..wirtinger import Wirtinger
from .approximator import NetworkApproximator
from .approximator_loss import LearningRates, vgg_weights
from .networks import Network


@dataclass(frozen=True)
class HILNH3D(LearnedLoop[NetworkApproximator]):
    """Ideal amplitude to captured amplitude by a U-Net, as Choi et al. 2021 compare with; SI units throughout.

    Parameters
    ----------
    network : Network
        The approximator, trained with an L1 loss of amplitudes.
    training : Schedule
        One round of captures of Wirtinger holograms.
    retrieval : SquaredErrorRetrieval
        Retrieval for the squared error of amplitude.
    start : Wirtinger
        Where every retrieval begins.
    rates : LearningRates
        Of Adam, while the network learns.
    """

    network: Network = Network(name="unet")
    training: Schedule = Schedule(rounds=1)
    retrieval: SquaredErrorRetrieval = SquaredErrorRetrieval()
    start: Wirtinger = Wirtinger(iterations=50)
    rates: LearningRates = LearningRates(generator=1e-3, decay=True)

    title: ClassVar[str] = "hardware in the loop, as Choi 2021 compares"
    version: ClassVar[int] = 3

    def external(self) -> dict[str, Path | None]:
        """Files that it takes where a machine has them, by what they hold; None for one that is not there."""
        return {**lpips_weights(self.retrieval), **vgg_weights(self.network, None)}

    def approximator(self, spec: DisplaySpec) -> NetworkApproximator:
        """The network, untrained."""
        return NetworkApproximator(
            spec, self.network, None, with_critic=False, seed=self.seed, of_amplitude=True, rates=self.rates
        )

    def prepare(self, bench: TrainingBench) -> Mapping[str, Any]:
        """See the base; its loss has no term that a region can be too small for."""
        return {name: value for name, value in super().prepare(bench).items() if name != "left_out"}

    def _retrieve(self, approximator: NetworkApproximator, display: Image, target: Tensor, start: Tensor) -> Tensor:
        def amplitude(phase: Tensor) -> Tensor:
            return display(phase).clamp_min(1e-12).sqrt()

        return retrieve(amplitude, target.sqrt(), start, self.retrieval)
