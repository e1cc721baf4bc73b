"""Learned hardware-in-the-loop phase retrieval.

Chakravarthula, Tseng, Srivastava, Fuchs & Heide, "Learned hardware-in-the-loop phase retrieval for holographic
near-eye displays", ACM Trans. Graph. 39(6), 186 (2020), Section 4.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor

from ...display.api import DisplaySpec
from ...display.metered import MeteredDisplay
from ...display.training import TrainingBench, TrainingImage
from ..learned.algorithm import train
from ..learned.method import frozen, hologram, predicted
from ..learned.retrieval import Image, PhaseRetrieval, check_region, retrieve
from ..learned.samples import Schedule
from .approximator import NetworkApproximator
from .approximator_loss import ApproximatorLoss
from .networks import Network
from .offset import best_offset
from .start import SmoothStart


@dataclass(frozen=True)
class HIL:
    """Phases retrieved through a network that learned, from captures, what the display makes of an ideal image.

    Chakravarthula et al. 2020, Section 4; SI units throughout.

    Parameters
    ----------
    network : Network
        The approximator D (Section 4.3.1) or a baseline of Table 1.
    loss : ApproximatorLoss, optional
        Eq. 20; None: the loss the network is published with.
    training : Schedule
        Algorithm 1.
    retrieval : PhaseRetrieval
        Eq. 22.
    start : SmoothStart
        Wirtinger holography, where Algorithm 1 and every retrieval begin. Not in the paper: it is stopped early, see
        `SmoothStart`. Of the tolerances 0.2, 0.1, 0.04 and 0.02 the default was best on captures of dead leaves, and
        within 0.3 dB of the best on darkened ones (their cube).
    offsets : int
        Not in the paper: constant phases that are tried on the display for the start, evenly over 2 pi, with captures
        of the first training images; the one of the least error is kept. An ideal image does not depend on it, and so
        nor does the network's input, but unmodulated light interferes with the image.
    seed : int
        Of the weights, besides the study's.
    """

    network: Network = Network()
    loss: ApproximatorLoss | None = None
    training: Schedule = Schedule()
    retrieval: PhaseRetrieval = PhaseRetrieval()
    start: SmoothStart = SmoothStart(tolerance=0.1)
    offsets: Annotated[int, Interval(ge=1, le=64)] = 8
    seed: int = 0

    camera: ClassVar[bool] = False
    privileged: ClassVar[bool] = False
    trains: ClassVar[bool] = True
    version: ClassVar[int] = 3

    def approximator(self, spec: DisplaySpec) -> NetworkApproximator:
        """D, untrained."""
        return NetworkApproximator(spec, self.network, self.loss, self.retrieval.adversarial > 0, self.seed)

    def prepare(self, bench: TrainingBench) -> Mapping[str, Any]:
        """Train the approximator on captures of the display (Algorithm 1).

        Parameters
        ----------
        bench : TrainingBench
            The display, the training images, and a memory that survives a kill.

        Returns
        -------
        mapping
            What `solve` and `predict` need: the weights of D and of the critic, and the constant phase [rad].

        Raises
        ------
        UserError
            For a region too small for a term of the retrieval's loss.
        BudgetError
            When no capture is left.
        """
        check_region(bench.spec.region.shape, self.retrieval)
        approximator = self.approximator(bench.spec).to(bench.device)
        offset = best_offset(bench, self.start, self.offsets)

        def start(image: TrainingImage) -> Tensor:
            return hologram(self.start, image, bench) + offset

        train(bench, approximator, start, partial(self._retrieve, approximator), self.training)
        return {**approximator.learned(), "offset": offset}

    def solve(self, target: Tensor, bench: MeteredDisplay) -> Tensor:
        """Phases of least loss (Eq. 22) in the captures that the approximator predicts.

        Parameters
        ----------
        target : Tensor
            Linear intensity ``(B, C, h, w)`` in [0, 1].
        bench : MeteredDisplay
            Nominal optics in SI units, and what `prepare` returned.

        Returns
        -------
        Tensor
            Phase ``(B, C, H, W)`` [rad].

        Raises
        ------
        CellError
            Where the method was not trained.
        UserError
            Where what was learned are the weights of another network.
        """
        approximator = frozen(self.approximator(bench.spec), bench)
        display = approximator.image(bench.light)
        start = self.start.solve(target, bench) + bench.learned["offset"]
        pairs = zip(target, start, strict=True)
        return torch.stack([self._retrieve(approximator, display, *pair) for pair in pairs])

    def predict(self, phase: Tensor, bench: MeteredDisplay) -> Tensor:
        """Captures that the approximator expects (Eq. 18).

        Parameters
        ----------
        phase : Tensor
            ``(B, C, H, W)`` [rad].
        bench : MeteredDisplay
            What `prepare` returned.

        Returns
        -------
        Tensor
            ``(B, C, h, w)`` linear light.
        """
        return predicted(frozen(self.approximator(bench.spec), bench).image(bench.light), phase)

    def _retrieve(self, approximator: NetworkApproximator, display: Image, target: Tensor, start: Tensor) -> Tensor:
        return retrieve(display, target, start, self.retrieval, approximator.verdict)
