"""Multi-scale oriented feature distance (MOFD): a perceptual distance that needs no trained weights.

The construction is this project's own. It follows LPIPS (Zhang et al., CVPR 2018) in outline, comparing normalised
features at several depths and averaging over the picture, with fixed filters in the place of a network: elongated
Gaussian derivatives, the standard model of simple cells (R. A. Young, Spatial Vision 2, 1987), rectified, and divided
by local energy (D. J. Heeger, Visual Neuroscience 9, 1992). It has not been fitted to human judgements.
"""

from __future__ import annotations

import math
from functools import lru_cache

import torch
from torch import Tensor
from torch.nn import functional

from .base import Metric, gaussian_blur, mix, paired

SCALES = 4
ORIENTATIONS = 4
RADIUS = 3
WIDTH_ACROSS, WIDTH_ALONG = 1.0, 1.5
POOLING_SIGMA = 2.0
CONTRAST_THRESHOLD = 0.02
COLOUR_THRESHOLD = 0.1
SMALLEST = 72

# Luma and two opponent colours, for which the eye has half the acuity.
OPPONENT = ((0.299, 0.587, 0.114), (0.5, -0.5, 0.0), (0.25, 0.25, -0.5))


@lru_cache(maxsize=8)
def _bank(dtype: torch.dtype, device: torch.device) -> Tensor:
    """First and second derivatives of an elongated Gaussian at 4 orientations, (8, 1, 7, 7), zero mean, unit length."""
    axis = torch.arange(-RADIUS, RADIUS + 1, dtype=torch.float64)
    y, x = torch.meshgrid(axis, axis, indexing="ij")
    kernels = []
    for orientation in range(ORIENTATIONS):
        angle = math.pi * orientation / ORIENTATIONS
        u = (x * math.cos(angle) + y * math.sin(angle)) / WIDTH_ACROSS
        v = (y * math.cos(angle) - x * math.sin(angle)) / WIDTH_ALONG
        envelope = torch.exp(-(u.square() + v.square()) / 2)
        for kernel in (-u * envelope, (u.square() - 1) * envelope):
            centred = kernel - envelope * (kernel.sum() / envelope.sum())
            kernels.append(centred / centred.norm())
    return torch.stack(kernels)[:, None].to(device, dtype)


def _opponent(image: Tensor, scale: int) -> Tensor:
    """What is filtered at a scale: luma, and from the second scale of a colour image on the opponent colours too."""
    if image.shape[1] == 1:
        return image
    return mix(image, OPPONENT if scale else OPPONENT[:1])


def _features(opponent: Tensor) -> Tensor:
    """Rectified responses of (B, K, H, W), positive and negative parts as channels of their own, (B, 16 K, H, W)."""
    batch, _, height, width = opponent.shape
    padded = functional.pad(opponent.reshape(-1, 1, height, width), (RADIUS,) * 4, mode="reflect")
    response = functional.conv2d(padded, _bank(opponent.dtype, opponent.device))
    response = response.reshape(batch, -1, height, width)
    return torch.cat([response.clamp_min(0), (-response).clamp_min(0)], dim=1)


def _structure_distance(x: Tensor, y: Tensor) -> Tensor:
    """Feature difference over feature energy, both pooled over a neighbourhood, and its mean: (B, K, H, W) to (B,)."""
    a, b = _features(x), _features(y)
    difference = (a - b).square().sum(1)
    energy = (a.square() + b.square()).sum(1)
    difference, energy = gaussian_blur(torch.stack([difference, energy]), POOLING_SIGMA).unbind()
    floor = 2 * ORIENTATIONS * CONTRAST_THRESHOLD**2
    local: Tensor = difference / (energy + floor)
    return local.mean(dim=(1, 2))


def mofd(image: Tensor, target: Tensor) -> Tensor:
    """Mean of the structure distances at four scales and of the colour distance of the low-pass images.

    1. A pyramid of 4 scales, each half the one before; luma, and from the second scale on two opponent colours.
    2. At each scale 8 filters (first and second derivative of a Gaussian of 1 x 1.5 px, 4 orientations), rectified.
    3. Per position: sum of squared feature differences over the sum of squared features of both images, both pooled
       with a Gaussian of 2 px, plus a floor that stands for a contrast of 0.02; averaged over the image.
    4. Colour of the last low-pass image (1/16 of the size): squared difference D over D + 0.1^2, averaged.
    image, target: (C, H, W) or (B, C, H, W) in [0, 1], sRGB encoded, sides of at least 72 px.
    Returns a scalar or (B,) in [0, 1]; lower is better, identical images give 0. Raises ValueError (see ``paired``).
    """
    x, y = paired(image, target, smallest=SMALLEST)
    parts = []
    for scale in range(SCALES):
        parts.append(_structure_distance(_opponent(x, scale), _opponent(y, scale)))
        x, y = (gaussian_blur(side, 1.0)[:, :, ::2, ::2] for side in (x, y))
    colour = (x - y).square().mean(1)
    parts.append((colour / (colour + COLOUR_THRESHOLD**2)).mean(dim=(1, 2)))
    return torch.stack(parts).mean(0).reshape(image.shape[:-3])


MOFD = Metric("mofd", "1", "lower", 0.0, ("srgb",), mofd, smallest=SMALLEST)
