"""Learned hardware-in-the-loop phase retrieval.

Chakravarthula, Tseng, Srivastava, Fuchs & Heide, "Learned hardware-in-the-loop phase retrieval for holographic
near-eye displays", ACM Trans. Graph. 39(6), 186 (2020), Section 4.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor

from .approximator import NetworkApproximator
from .loop import Rounds, train_in_the_loop
from .networks import Network
from .objective import Objective
from .offset import best_offset
from .retrieval import Image, Retrieval, check_region, retrieve
from .start import SmoothStart

if TYPE_CHECKING:
    from ...display.metered import MeteredDisplay
    from ...display.training import TrainingBench, TrainingImage


@dataclass(frozen=True)
class HIL:
    """Phases retrieved through a network that learned, from captures, what the display makes of an ideal image.

    network: the approximator (Section 4.3.1) or a baseline of Table 1. loss: Eq. 20 (None: the one the network is
    published with). training: Algorithm 1. retrieval: Eq. 22. seed: of the weights, besides the study's.
    start: Wirtinger holography, where Algorithm 1 and every retrieval begin; stopped early, see ``SmoothStart``. Of the
    tolerances 0.2, 0.1, 0.04 and 0.02 the default was best on captures of dead leaves, and within 0.3 dB of the best on
    darkened ones (their cube).
    offsets: constant phases that are tried on the display for the start, evenly over 2 pi, with captures of the first
    training images; the one of the least error is kept. An ideal image does not depend on it, and so nor does the
    network's input, but unmodulated light interferes with the image.
    """

    network: Network = Network()
    loss: Objective | None = None
    training: Rounds = Rounds()
    retrieval: Retrieval = Retrieval()
    start: SmoothStart = SmoothStart(tolerance=0.1)
    offsets: Annotated[int, Interval(ge=1, le=64)] = 8
    seed: int = 0

    camera: ClassVar[bool] = False
    privileged: ClassVar[bool] = False
    trains: ClassVar[bool] = True
    version: ClassVar[int] = 2

    def prepare(self, bench: TrainingBench) -> Mapping[str, Any]:
        """Train the approximator on captures of the display; what ``solve`` and ``predict`` need of it."""
        check_region(bench.spec.region.shape, self.retrieval)
        approximator = self._approximator(bench)
        offset = best_offset(bench, self.start, self.offsets)

        def begin(image: TrainingImage) -> Tensor:
            return self.start.solve(image.target[None], bench)[0] + offset

        def search(display: Image, target: Tensor, phase: Tensor) -> Tensor:
            return retrieve(display, target, phase, self.retrieval, approximator.judge)

        train_in_the_loop(bench, approximator, begin, search, self.training)
        return {**approximator.learned(), "offset": offset}

    def solve(self, target: Tensor, bench: MeteredDisplay) -> Tensor:
        """Linear intensity ``(B, C, h, w)`` to phase ``(B, C, H, W)`` [rad]."""
        approximator = self._frozen(bench)
        display, start = approximator.image(bench.light), self.start.solve(target, bench) + bench.learned["offset"]
        found = [
            retrieve(display, image, phase, self.retrieval, approximator.judge)
            for image, phase in zip(target, start, strict=True)
        ]
        return torch.stack(found)

    @torch.no_grad()
    def predict(self, phase: Tensor, bench: MeteredDisplay) -> Tensor:
        """Phase ``(B, C, H, W)`` [rad] to the capture ``(B, C, h, w)`` that the approximator expects."""
        display = self._frozen(bench).image(bench.light)
        return torch.stack([display(one) for one in phase])

    def _approximator(self, bench: TrainingBench | MeteredDisplay) -> NetworkApproximator:
        judged = self.retrieval.adversarial > 0
        return NetworkApproximator(bench.spec, self.network, self.loss, judged, self.seed).to(bench.device)

    def _frozen(self, bench: MeteredDisplay) -> NetworkApproximator:
        approximator = self._approximator(bench)
        approximator.load_learned(bench.learned)
        return approximator
