"""The loss of the aberration approximator, Eq. 20, and its adversary's.

Chakravarthula et al. 2020, Sections 4.3.1 and 5.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import torch
from annotated_types import Interval
from torch import Tensor
from torch.nn import functional

from ...core.errors import UserError
from ..learned.retrieval import Weight
from .networks import Network
from .perceptual import find_weights

Gan = Literal["cross_entropy", "least_squares"]

LEARNING_RATE = 2e-4
BETAS = (0.5, 0.999)

Rate = Annotated[float, Interval(gt=0, le=1)]


@dataclass(frozen=True)
class LearningRates:
    """Adam's rates, by default those of Section 5.2.

    Parameters
    ----------
    generator, discriminator : float
        The first rate in every round.
    decay : bool
        Not in the paper: the generator's rate falls to zero along half a cosine in every round.
    """

    generator: Rate = LEARNING_RATE
    discriminator: Rate = LEARNING_RATE
    decay: bool = False


PUBLISHED_RATES = LearningRates()


@dataclass(frozen=True)
class ApproximatorLoss:
    """Weights of the generator's loss, by default those of Eq. 20; a term of weight 0 is not computed.

    Parameters
    ----------
    l1, l2 : float
        Of the mean absolute and (not in the paper) the mean squared error.
    perceptual : float
        Of Eq. 21.
    adversarial : float
        Of the discriminator's verdict.
    feature_matching : float
        Not in the paper: of the mean absolute differences of the discriminator's features, summed over layers and
        scales (T.-C. Wang et al. 2018, Eq. 4).
    gan : {"cross_entropy", "least_squares"}
        How the verdict becomes a loss.
    """

    l1: Weight = 10.0
    l2: Weight = 0.0
    perceptual: Weight = 0.05
    adversarial: Weight = 0.5
    feature_matching: Weight = 0.0
    gan: Gan = "cross_entropy"

    def __post_init__(self) -> None:
        if not any((self.l1, self.l2, self.perceptual, self.adversarial, self.feature_matching)):
            raise UserError("loss: every weight is 0; give at least one of l1, l2, perceptual, adversarial a weight")

    @property
    def needs_discriminator(self) -> bool:
        """Does a term ask the discriminator?"""
        return self.adversarial > 0 or self.feature_matching > 0


def published_loss(network: Network) -> ApproximatorLoss:
    """The loss a network is published with; for U-Net, which is published for segmentation, the paper's L1.

    Pix2PixHD's perceptual term needs VGG-19 and is left out without its weights.
    """
    if network.name == "pix2pix":
        return ApproximatorLoss(l1=100.0, perceptual=0.0, adversarial=1.0)
    if network.name == "pix2pixhd":
        perceptual = 10.0 if find_weights() else 0.0
        return ApproximatorLoss(0.0, 0.0, perceptual, adversarial=1.0, feature_matching=10.0, gan="least_squares")
    if network.name in ("unet", "identity"):
        return ApproximatorLoss(l1=1.0, perceptual=0.0, adversarial=0.0)
    return ApproximatorLoss()


def vgg_weights(network: Network, loss: ApproximatorLoss | None) -> dict[str, Path | None]:
    """The file that a loss takes where it is there, by what it holds; empty for a loss without a perceptual term.

    loss: None for the one that the network is published with.
    """
    is_used = published_loss(network).perceptual or network.name == "pix2pixhd" if loss is None else loss.perceptual
    return {"VGG-19 weights": find_weights()} if is_used else {}


def adversarial_loss(judged: list[list[Tensor]], wanted: float, gan: Gan) -> Tensor:
    """Distance of a discriminator's logits from ``wanted``, 1: capture, 0: prediction; averaged, summed over scales."""
    compare = functional.binary_cross_entropy_with_logits if gan == "cross_entropy" else functional.mse_loss
    verdicts = [activations[-1] for activations in judged]
    return torch.stack([compare(verdict, torch.full_like(verdict, wanted)) for verdict in verdicts]).sum()


def discriminator_loss(predicted: list[list[Tensor]], captured: list[list[Tensor]], gan: Gan) -> Tensor:
    """The adversary's loss: halved, to slow it down against the generator (Isola et al., Section 3.3)."""
    return (adversarial_loss(predicted, 0.0, gan) + adversarial_loss(captured, 1.0, gan)) / 2


def feature_matching_loss(judged: list[list[Tensor]], captured: list[list[Tensor]]) -> Tensor:
    """Mean absolute difference of each layer's features, the logits apart, summed over layers and scales."""
    scales = zip(judged, captured, strict=True)
    differences = [
        functional.l1_loss(a, b) for ours, theirs in scales for a, b in zip(ours[:-1], theirs[:-1], strict=True)
    ]
    return torch.stack(differences).sum()
