"""Mean deviation similarity index.

H. Ziaei Nafchi, A. Shahkolaei, R. Hedjam, M. Cheriet, "Mean deviation similarity index: efficient and reliable
full-reference image quality evaluator", IEEE Access 4 (2016).
"""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.nn import functional

from .base import Metric, as_rgb, block_means, gradient_magnitude, mix, paired, safe_sqrt, similarity

# Rows: luminance and the two chromaticities H and M of the Gaussian colour model.
LHM = ((0.2989, 0.587, 0.114), (0.3, 0.04, -0.35), (0.34, -0.6, 0.17))
C1, C2, C3 = 140.0, 55.0, 550.0
ALPHA = 0.6
POWER = 0.25


def _reduced(image: Tensor) -> Tensor:
    """(B, C, H, W) averaged over k x k pixels, k = shorter side / 256 rounded, after k - 1 zeros at the edges."""
    k = max(1, round(min(image.shape[-2:]) / 256))
    before, after = (k - 1) // 2, k // 2
    return block_means(functional.pad(image, (before, after, before, after)), k)


def mdsi(image: Tensor, target: Tensor) -> Tensor:
    """Mean deviation of the pooled gradient and chromaticity similarity (Eq. 3-11 of the paper, summation form).

    Values in [0, 255]; C1 = 140, C2 = 55, C3 = 550, alpha = 0.6, rho = 1, q = o = 1/4. It is not symmetric: the
    gradient of the mean image is compared with each side by opposite signs.

    Parameters
    ----------
    image, target
        ``(C, H, W)`` or ``(B, C, H, W)`` in [0, 1], sRGB encoded, C = 1 or 3, sides of at least 3 px; gray
        is taken as three equal channels.

    Returns
    -------
    Tensor
        Scalar or ``(B,)``; lower is better, identical images give 0.

    Raises
    ------
    ValueError
        Wrong shapes, types or values; see ``base.paired``.
    """
    x, y = (mix(_reduced(255 * as_rgb(side)), LHM) for side in paired(image, target, smallest=3))
    gradient_x = gradient_magnitude(x[:, :1], "prewitt")
    gradient_y = gradient_magnitude(y[:, :1], "prewitt")
    gradient_mean = gradient_magnitude((x[:, :1] + y[:, :1]) / 2, "prewitt")
    gradients = (
        similarity(gradient_x, gradient_y, C1)
        + similarity(gradient_x, gradient_mean, C2)
        - similarity(gradient_y, gradient_mean, C2)
    )
    products = (x[:, 1:] * y[:, 1:]).sum(1, keepdim=True)
    squares = (x[:, 1:].square() + y[:, 1:].square()).sum(1, keepdim=True)
    alike = ALPHA * gradients + (1 - ALPHA) * (2 * products + C3) / (squares + C3)
    # A negative similarity has a complex fourth root; real and imaginary part are carried apart.
    length = alike.abs().clamp_min(1e-12).pow(POWER)
    angle = torch.where(alike < 0, POWER * math.pi, 0.0).to(length)
    deviation = length.new_zeros(length.shape)
    for part in (length * angle.cos(), length * angle.sin()):
        deviation = deviation + (part - part.mean(dim=(2, 3), keepdim=True)).square()
    mean = safe_sqrt(deviation).mean(dim=(1, 2, 3))
    return torch.where(mean > 0, torch.where(mean > 0, mean, 1.0).pow(POWER), 0.0).reshape(image.shape[:-3])


METRIC = Metric("mdsi", "1", "lower", 0.0, ("srgb",), mdsi, smallest=3, title="MDSI")
