"""Learned hardware-in-the-loop phase retrieval.

Chakravarthula, Tseng, Srivastava, Fuchs & Heide, "Learned hardware-in-the-loop phase retrieval for holographic
near-eye displays", ACM Trans. Graph. 39(6), 186 (2020), Section 4.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import torch
from torch import Tensor

from ...display.api import DisplaySpec
from ...display.metered import MeteredDisplay
from ...display.training import TrainingBench, TrainingImage
from ..learned.algorithm import train
from ..learned.fallback import WIRTINGER, fell_back
from ..learned.method import frozen, hologram, predicted
from ..learned.retrieval import Image, PhaseRetrieval, left_out, lpips_weights, retrieve
from ..learned.samples import Schedule
from ..wirtinger import Wirtinger
from .approximator import NetworkApproximator
from .approximator_loss import ApproximatorLoss, LearningRates, vgg_weights
from .networks import Network


@dataclass(frozen=True)
class HIL:
    """Phases retrieved through a network that learned, from captures, what the display makes of an ideal image.

    Chakravarthula et al. 2020, Section 4; SI units throughout.

    Parameters
    ----------
    network : Network
        The approximator D (Section 4.3.1) or a baseline of Table 1.
    loss : ApproximatorLoss, optional
        Eq. 20; by default the loss that the network is published with.
    training : Schedule
        How the display is learned: Algorithm 1.
    retrieval : PhaseRetrieval
        Of every hologram, through what was learned: Eq. 22. From a converged phase, steps of 0.06 rad gained twice as
        much on captures of dead leaves as steps of 0.0075 rad, which take it as far as the paper's 300 steps of 0.001
        rad.
    start : Wirtinger
        Wirtinger holography, where Algorithm 1 and every retrieval begin.
    rates : LearningRates
        Of Adam, while the approximator learns. Those of the paper are for its 40000 steps.
    seed : int
        Of the weights, besides the study's.
    fallback : bool
        Not in the paper: solve by plain Wirtinger holography where the loop made the captures of held-out images worse.
    """

    network: Network = Network()
    loss: ApproximatorLoss | None = None
    training: Schedule = Schedule()
    retrieval: PhaseRetrieval = PhaseRetrieval(step=0.06)
    start: Wirtinger = Wirtinger()
    rates: LearningRates = LearningRates(generator=1e-3, discriminator=5e-5, decay=True)
    seed: int = 0
    fallback: bool = False

    title: ClassVar[str] = "hardware in the loop, Chakravarthula 2020"
    tuned: ClassVar[str] = (
        "the network (a quarter of the paper's filters, 1,300 steps for 40,000), rates and steps were chosen on a "
        "trial display that resembles leto-hazy, with generated images"
    )
    trains: ClassVar[bool] = True
    version: ClassVar[int] = 4

    def external(self) -> dict[str, Path | None]:
        """Files that it takes where a machine has them, by what they hold; None for one that is not there."""
        return {**lpips_weights(self.retrieval), **vgg_weights(self.network, self.loss)}

    def approximator(self, spec: DisplaySpec) -> NetworkApproximator:
        """D, untrained."""
        with_critic = self.retrieval.adversarial > 0
        return NetworkApproximator(spec, self.network, self.loss, with_critic, self.seed, rates=self.rates)

    def prepare(self, bench: TrainingBench) -> Mapping[str, Any]:
        """Train the approximator on captures of the display (Algorithm 1).

        Parameters
        ----------
        bench : TrainingBench
            The display, the training images, and a memory that survives a kill.

        Returns
        -------
        mapping
            What `solve` and `predict` need: the weights of D and of the critic, and whether Wirtinger holography was
            better; ``left_out``, the terms of the retrieval's loss that the region is too small for.

        Raises
        ------
        BudgetError
            When no capture is left.
        """
        approximator = self.approximator(bench.spec).to(bench.device)
        start, minimise = partial(hologram, self.start, bench=bench), partial(self._retrieve, approximator)
        train(bench, approximator, start, minimise, self.training)

        def solve(image: TrainingImage) -> Tensor:
            return minimise(approximator.image(bench.light(image)), image.target, start(image))

        lacks = left_out(bench.spec.region.shape, self.retrieval)
        return {**approximator.learned(), "fell_back": fell_back(self.fallback, bench, solve), "left_out": lacks}

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
        if bench.learned["fell_back"]:
            return bench.solved(WIRTINGER, target)
        approximator = frozen(self.approximator(bench.spec), bench)
        display = approximator.image(bench.light)
        start = bench.solved(self.start, target)
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
