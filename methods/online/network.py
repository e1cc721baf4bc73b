"""Algorithm 1 for a single image: a network learns the display around one hologram, which is retrieved through it.

Chakravarthula, Tseng, Srivastava, Fuchs & Heide, "Learned hardware-in-the-loop phase retrieval for holographic
near-eye displays", ACM Trans. Graph. 39(6), 186 (2020), Sections 4.4 and 4.5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor

from ...display.metered import MeteredDisplay
from ...metrics.base import gaussian_blur
from ..hil.approximator import NetworkApproximator
from ..hil.approximator_loss import ApproximatorLoss, vgg_weights
from ..hil.networks import Network
from ..learned.retrieval import Image, SquaredErrorRetrieval, lpips_weights, retrieve
from ..learned.samples import Sample
from .start import Camera, OnlineLoop

# Width [px] of the Gaussian that what the network misses of the captures is filtered with.
SMOOTHING = 0.7


@dataclass(frozen=True)
class ShortRetrieval(SquaredErrorRetrieval):
    """A short way: what a network learned of one hologram does not hold far from it."""

    iterations: Annotated[int, Interval(ge=0, le=100_000)] = 20
    step: Annotated[float, Interval(gt=0, le=10)] = 0.01


@dataclass(frozen=True)
class OnlineCameraNetwork(OnlineLoop):
    """Rounds of captures, refinement of the image's own network with all of them, and retrieval through it, held.

    Chakravarthula et al. 2020, Section 4.5; SI units throughout. Not in the paper: what the network still misses of a
    round's captures is added to its predictions, so that the retrieval starts from what the camera saw, and only
    changes are left to the network.

    Parameters
    ----------
    captures : int
        In all; there are as many rounds as they are enough for.
    neighbours : int
        Not in the paper: how many holograms near the present one are captured with it in every round, so that the
        network sees how captures change.
    perturbation : float
        Not in the paper: by how much these differ from it, normal noise [rad rms].
    steps : int
        Of the network's training in a round.
    network : Network
        What learns the display, with fresh weights for every image: D of the paper.
    loss : ApproximatorLoss, optional
        Eq. 20, of which the L1 term alone is worth its time in so few steps; null: the network's published loss.
    retrieval : ShortRetrieval
        Eq. 22, of which the squared error alone is used.
    """

    captures: Annotated[int, Interval(ge=1, le=100_000)] = 100
    neighbours: Annotated[int, Interval(ge=0, le=1000)] = 3
    perturbation: Annotated[float, Interval(gt=0, le=10)] = 0.1
    steps: Annotated[int, Interval(ge=1, le=1_000_000)] = 12
    network: Network = Network()
    loss: ApproximatorLoss | None = ApproximatorLoss(perceptual=0, adversarial=0)
    retrieval: ShortRetrieval = ShortRetrieval()

    title: ClassVar[str] = "camera in the loop through a network"

    def external(self) -> dict[str, Path | None]:
        """Files that it takes where a machine has them, by what they hold; None for one that is not there."""
        return {**lpips_weights(self.retrieval), **vgg_weights(self.network, self.loss)}

    def _optimise(
        self, phase: Tensor, target: Tensor, bench: MeteredDisplay, camera: Camera, kept: int, index: int
    ) -> Tensor:
        draw = bench.generator("neighbours", index)
        approximator, samples = self._fresh(bench, draw), list[Sample]()
        while camera.left - kept > self.neighbours:
            shown = [phase, *(phase + self.perturbation * noise for noise in self._noise(phase, draw))]
            fresh = [Sample(one, camera.show(one), target, bench.light) for one in shown]
            if not samples:
                approximator.expose(fresh)
            samples += fresh
            for step in range(self.steps):
                chosen = int(torch.randint(len(samples), (), generator=draw))
                approximator.step(samples[chosen], step / self.steps)
            phase = retrieve(corrected(approximator.image(bench.light), fresh), target, phase, self.retrieval)
        return phase

    def _fresh(self, bench: MeteredDisplay, draw: torch.Generator) -> NetworkApproximator:
        """An approximator that has seen nothing; D = Id."""
        seed = int(torch.randint(2**31, (), generator=draw))
        approximator = NetworkApproximator(bench.spec, self.network, self.loss, with_critic=False, seed=seed)
        return approximator.to(bench.device)

    def _noise(self, phase: Tensor, draw: torch.Generator) -> Tensor:
        return torch.randn((self.neighbours, *phase.shape), generator=draw).to(phase.device)


def corrected(display: Image, samples: Sequence[Sample]) -> Image:
    """A display as it is predicted, with the mean of what the prediction misses of some captures added."""
    with torch.no_grad():
        missed = torch.stack([one.capture - display(one.phase) for one in samples]).mean(0)
        missed = gaussian_blur(missed[None], SMOOTHING)[0]
    return lambda phase: display(phase) + missed
