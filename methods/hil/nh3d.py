"""The hardware-in-the-loop baseline of Neural 3D Holography: an amplitude U-Net trained with an L1 loss.

Choi, Gopakumar, Peng, Kim & Wetzstein, "Neural 3D holography: learning accurate wave propagation models for 3D
holographic virtual and augmented reality displays", ACM Trans. Graph. 40(6), 240 (2021), compare with a model of this
form under the name of Chakravarthula et al. 2020. It is not that paper's network, hence a name of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import torch
from torch import Tensor

from ..wirtinger import Wirtinger
from .approximator import NetworkApproximator
from .loop import Rounds, train_in_the_loop
from .networks import Network
from .retrieval import Image, SquaredErrorRetrieval, check_region, retrieve

if TYPE_CHECKING:
    from ...display.api import DisplaySpec
    from ...display.metered import MeteredDisplay
    from ...display.training import TrainingBench, TrainingImage


@dataclass(frozen=True)
class HILNH3D:
    """Ideal amplitude to captured amplitude by a U-Net, L1; one round of captures of Wirtinger holograms; retrieval for
    the squared error of amplitude. seed: of the weights, besides the study's.
    """

    network: Network = Network(name="unet")
    training: Rounds = Rounds(rounds=1)
    retrieval: SquaredErrorRetrieval = SquaredErrorRetrieval()
    start: Wirtinger = Wirtinger(iterations=50)
    seed: int = 0

    camera: ClassVar[bool] = False
    privileged: ClassVar[bool] = False
    trains: ClassVar[bool] = True
    version: ClassVar[int] = 1

    def prepare(self, bench: TrainingBench) -> Mapping[str, Any]:
        """Train the network on captures of the display; what ``solve`` and ``predict`` need of it."""
        check_region(bench.spec.region.shape, self.retrieval)
        approximator = self._approximator(bench.spec).to(bench.device)

        def begin(image: TrainingImage) -> Tensor:
            return self.start.solve(image.target[None], bench)[0]

        train_in_the_loop(bench, approximator, begin, self._search, self.training)
        return approximator.learned()

    def solve(self, target: Tensor, bench: MeteredDisplay) -> Tensor:
        """Linear intensity ``(B, C, h, w)`` to phase ``(B, C, H, W)`` [rad]."""
        display, start = self._display(bench), self.start.solve(target, bench)
        return torch.stack([self._search(display, image, phase) for image, phase in zip(target, start, strict=True)])

    @torch.no_grad()
    def predict(self, phase: Tensor, bench: MeteredDisplay) -> Tensor:
        """Phase ``(B, C, H, W)`` [rad] to the capture ``(B, C, h, w)``, linear light, that the network expects."""
        display = self._display(bench)
        return torch.stack([display(one) for one in phase])

    def _search(self, display: Image, target: Tensor, phase: Tensor) -> Tensor:
        def amplitude(shown: Tensor) -> Tensor:
            return display(shown).clamp_min(1e-12).sqrt()

        return retrieve(amplitude, target.sqrt(), phase, self.retrieval)

    def _approximator(self, spec: DisplaySpec) -> NetworkApproximator:
        return NetworkApproximator(spec, self.network, None, with_judge=False, seed=self.seed, of_amplitude=True)

    def _display(self, bench: MeteredDisplay) -> Image:
        approximator = self._approximator(bench.spec).to(bench.device)
        approximator.load_learned(bench.learned)
        return approximator.image(bench.light)
