"""Haar wavelet-based perceptual similarity index.

R. Reisenhofer, S. Bosse, G. Kutyniok, T. Wiegand, "A Haar wavelet-based perceptual similarity index for image quality
assessment", Signal Process. Image Commun. 61 (2018).
"""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

from .base import Metric, halved, mix, paired, similarity

YIQ = ((0.299, 0.587, 0.114), (0.5959, -0.2746, -0.3213), (0.2115, -0.5227, 0.3112))
C = 30.0
ALPHA = 4.2
STRIP = 2**17  # pixels


def _haar(luma: Tensor, size: int) -> Tensor:
    """Magnitudes of the Haar responses of (B, 1, H, W) across rows and across columns, (B, 2, H, W)."""
    kernel = luma.new_full((size, size), 1 / size)
    kernel[size // 2 :] *= -1
    before, after = size // 2 - 1, size // 2
    padded, both = functional.pad(luma, (before, after, before, after)), torch.stack([kernel, kernel.T])[:, None]
    # In strips, as the convolution copies every pixel for each weight of the filter.
    rows = max(1, STRIP // luma.shape[-1])
    strips = (padded[:, :, top : top + rows + size - 1] for top in range(0, luma.shape[-2], rows))
    return torch.cat([functional.conv2d(strip, both).abs() for strip in strips], dim=2)


def haarpsi(image: Tensor, target: Tensor) -> Tensor:
    """Similarity of Haar coefficients at two scales, weighted by those of the third (Eq. 10-12 of the paper).

    Images are halved by 2x2 means first, values scaled to [0, 255]; C = 30, alpha = 4.2; colour adds the similarity of
    the I and Q channels of YIQ, averaged over 2x2 pixels.

    Parameters
    ----------
    image, target
        ``(C, H, W)`` or ``(B, C, H, W)`` in [0, 1], sRGB encoded, C = 1 or 3, sides of at least 2 px.

    Returns
    -------
    Tensor
        Scalar or ``(B,)``; higher is better, identical images give 1.

    Raises
    ------
    ValueError
        Wrong shapes, types or values; see ``base.paired``.
    """
    # A channel at a time: of a large image the scaled values are as large as itself.
    planes = (side.split(1, dim=1) for side in paired(image, target, smallest=2))
    x, y = (torch.cat([halved(255 * plane) for plane in side], dim=1) for side in planes)
    if x.shape[1] == 3:
        x, y = mix(x, YIQ), mix(y, YIQ)
    fine = similarity(_haar(x[:, :1], 2), _haar(y[:, :1], 2), C)
    middle = similarity(_haar(x[:, :1], 4), _haar(y[:, :1], 4), C)
    local = (fine + middle) / 2
    weights = torch.maximum(_haar(x[:, :1], 8), _haar(y[:, :1], 8))
    if x.shape[1] == 3:
        chroma = [
            functional.avg_pool2d(functional.pad(side[:, 1:], (0, 1, 0, 1)), 2, stride=1).abs() for side in (x, y)
        ]
        local = torch.cat([local, similarity(chroma[0], chroma[1], C).mean(1, keepdim=True)], dim=1)
        weights = torch.cat([weights, weights.mean(1, keepdim=True)], dim=1)
    total = weights.sum(dim=(1, 2, 3))
    weighted = ((ALPHA * local).sigmoid() * weights).sum(dim=(1, 2, 3))
    # Two black images have no coefficients to weigh by: they are alike.
    empty = total == 0
    mean = torch.where(empty, 0.5, weighted / torch.where(empty, 1.0, total))
    return torch.where(empty, 1.0, (mean.logit() / ALPHA).square()).reshape(image.shape[:-3])


METRIC = Metric("haarpsi", "1", "higher", 1.0, ("srgb",), haarpsi, smallest=2, title="HaarPSI")
