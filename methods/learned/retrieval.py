"""Phase retrieval through a frozen approximator of the display: Eq. 22 and its Wirtinger gradient.

Chakravarthula et al. 2020, Sections 4.4 and 5.2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import torch
from annotated_types import Interval
from torch import Tensor
from torch.nn import functional

from ...metrics.feature_distance import SMALLEST_MOFD, FixedMofd
from ...metrics.lpips import available, find_weights, lpips
from ...metrics.ms_ssim import EXPONENTS, FixedMsSsim, fitting_scales
from ...optics import srgb_encode
from ..common import matched
from ..descent import adam, by_autograd

Weight = Annotated[float, Interval(ge=0, le=1e6)]

# Phase (C, H, W) [rad] to the predicted capture (C, h, w), differentiable.
Image = Callable[[Tensor], Tensor]
# A picture (1, C, h, w) to its adversarial loss.
Verdict = Callable[[Tensor], Tensor]


@dataclass(frozen=True)
class PhaseRetrieval:
    """Adam on the phase for Eq. 22 of Chakravarthula et al. 2020, from a start that the method chooses.

    A term of weight 0 is not computed. A picture of less than 161 px on its short side has MS-SSIM at as many scales as
    fit, and one of less than 72 px no perceptual distance.

    Parameters
    ----------
    iterations : int
        0 leaves the start as it is; the paper takes 300.
    step : float
        Adam's step [rad], cosine-decayed to zero (not in the paper, whose step of 0.001 rad is constant). From a smooth
        start on `leto-aged`, twice this step lost 0.6 dB on captures of dead leaves: the network is to be believed near
        its start alone.
    perceptual : float
        Weight of LPIPS where its weights are found, else of the weight-free feature distance (``mofd``, not in the
        paper), of sRGB pictures; 1 in the paper, which gives none of the other three.
    ms_ssim, l2 : float
        Weights of MS-SSIM and of the squared error, in linear light.
    adversarial : float
        Weight of the verdict of a critic, where the method has one.
    threshold : float
        Stop when the mean squared error of the predicted picture is below.
    """

    iterations: Annotated[int, Interval(ge=0, le=100_000)] = 60
    step: Annotated[float, Interval(gt=0, le=10)] = 0.0075
    perceptual: Weight = 1.0
    ms_ssim: Weight = 1.0
    l2: Weight = 10.0
    adversarial: Weight = 0.01
    threshold: Annotated[float, Interval(ge=0)] = 0.0


@dataclass(frozen=True)
class SquaredErrorRetrieval(PhaseRetrieval):
    """`PhaseRetrieval` for the squared error alone, for methods without a critic."""

    perceptual: Weight = 0.0
    ms_ssim: Weight = 0.0
    adversarial: Annotated[float, Interval(ge=0, le=0)] = 0.0


class PictureLoss:
    """Eq. 22 for one target ``(C, h, w)``, of which everything that does not change is computed once.

    The perceptual distance is LPIPS if its weights are there, else the project's feature distance.
    """

    def __init__(self, target: Tensor, settings: PhaseRetrieval, verdict: Verdict | None) -> None:
        self.target, self.settings, self.verdict = target, settings, verdict
        wanted = target[None]
        encoded = srgb_encode(wanted)
        scales = fitting_scales((target.shape[-2], target.shape[-1]))
        self.structure = FixedMsSsim(wanted, scales) if settings.ms_ssim and scales else None
        self.perceptual: Callable[[Tensor], Tensor] | None = None
        if settings.perceptual and min(target.shape[-2:]) >= SMALLEST_MOFD:
            self.perceptual = FixedMofd(encoded) if available("alex") else lambda picture: lpips(picture, encoded)

    def __call__(self, image: Tensor) -> tuple[Tensor, Tensor]:
        """The loss of a predicted capture ``(C, h, w)``, and its mean squared error alone."""
        weights, picture = self.settings, matched(image, self.target)
        error = functional.mse_loss(picture, self.target)
        loss = weights.l2 * error
        clipped = picture.clamp(0, 1)[None]
        if self.perceptual is not None:
            loss = loss + weights.perceptual * self.perceptual(srgb_encode(clipped)).mean()
        if self.structure is not None:
            loss = loss + weights.ms_ssim * (1 - self.structure(clipped).mean())
        if weights.adversarial and self.verdict is not None:
            loss = loss + weights.adversarial * self.verdict(picture[None])
        return loss, error.detach()


def lpips_weights(*settings: PhaseRetrieval) -> dict[str, Path | None]:
    """The file that the perceptual term of a retrieval takes where it is there, by what it holds; empty without it."""
    if not any(each.perceptual for each in settings):
        return {}
    return {"LPIPS weights (AlexNet)": None if available("alex") else find_weights("alex")}


def left_out(shape: tuple[int, int], settings: PhaseRetrieval) -> str:
    """What of the loss a picture ``(h, w)`` is too small for, in words; empty where it is computed entirely."""
    missing = len(EXPONENTS) - fitting_scales(shape)
    parts = []
    if settings.ms_ssim and missing:
        parts.append(f"MS-SSIM at {missing} of its {len(EXPONENTS)} scales")
    if settings.perceptual and min(shape) < SMALLEST_MOFD:
        parts.append("the perceptual distance")
    return " and ".join(parts)


def retrieve(
    image: Image, target: Tensor, start: Tensor, settings: PhaseRetrieval, verdict: Verdict | None = None
) -> Tensor:
    """The phase ``(C, H, W)`` [rad] near ``start`` whose predicted capture looks most like ``target`` ``(C, h, w)``."""
    picture_loss, error = PictureLoss(target, settings, verdict), torch.tensor(torch.inf)

    def loss(phase: Tensor) -> Tensor:
        nonlocal error
        value, error = picture_loss(image(phase[0]))
        return value[None]

    def done(_: Tensor) -> bool:
        return settings.threshold > 0 and float(error) < settings.threshold

    return adam(start[None], by_autograd(loss), settings.iterations, settings.step, decay=True, done=done)[0]
