"""Structural similarity.

Z. Wang, A. C. Bovik, H. R. Sheikh, E. P. Simoncelli, "Image quality assessment: from error visibility to structural
similarity", IEEE Trans. Image Process. 13 (2004).
"""

from __future__ import annotations

from collections.abc import Iterator

import torch
from torch import Tensor

from .base import Metric, gaussian_valid, paired

SIGMA = 1.5
RADIUS = 5
C1 = 0.01**2
C2 = 0.03**2
STRIP = 32
"""Rows."""


class LocalStatistics:
    """Local mean and variance of an image (..., H, W), to compare others with: its windows are filtered once.

    Maps are (..., H - 10, W - 10): only pixels whose whole window lies in the image are kept.
    """

    def __init__(self, image: Tensor) -> None:
        self.image = image
        self.mean, squares = gaussian_valid(torch.stack([image, image.square()]), SIGMA, RADIUS).unbind()
        self.mean_squared = self.mean.square()
        self.variance = squares - self.mean_squared

    def maps(self, other: Tensor) -> tuple[Tensor, Tensor]:
        """Luminance and contrast-structure factor of the SSIM (Eq. 6, and 9 with 10, of the paper) of another image."""
        moments = gaussian_valid(torch.stack([other, other.square(), other * self.image]), SIGMA, RADIUS)
        mean, squares, product = moments.unbind()
        mean_squared, mean_product = mean.square(), mean * self.mean
        structure = (2 * (product - mean_product) + C2) / (squares - mean_squared + self.variance + C2)
        luminance = (2 * mean_product + C1) / (mean_squared + self.mean_squared + C1)
        return luminance, structure


def ssim(image: Tensor, target: Tensor) -> Tensor:
    """Mean SSIM: 11-tap Gaussian window of sigma 1.5 px, K1 = 0.01, K2 = 0.03, data range 1, population covariance.

    It equals scikit-image's ``structural_similarity`` with ``gaussian_weights=True, sigma=1.5,
    use_sample_covariance=False, data_range=1``; channels are averaged.
    image, target: (C, H, W) or (B, C, H, W) in [0, 1], sides of at least 11 px.
    Returns a scalar or (B,); higher is better, at most 1. Raises ValueError (see ``paired``).
    """
    x, y = paired(image, target, smallest=2 * RADIUS + 1)
    total = torch.zeros(len(x), dtype=x.dtype, device=x.device)
    count = x.shape[1] * (x.shape[2] - 2 * RADIUS) * (x.shape[3] - 2 * RADIUS)
    for rows in _strips(x.shape[2], x.requires_grad or y.requires_grad):
        luminance, structure = LocalStatistics(y[:, :, rows]).maps(x[:, :, rows])
        total = total + (luminance * structure).sum(dim=(1, 2, 3))
    return (total / count).reshape(image.shape[:-3])


def _strips(height: int, whole: bool) -> Iterator[slice]:
    """Rows that are compared together, with the windows' reach at either end: few enough to stay in the cache."""
    inner = height - 2 * RADIUS
    step = inner if whole else STRIP
    return (slice(first, min(first + step, inner) + 2 * RADIUS) for first in range(0, inner, step))


SSIM = Metric("ssim", "1", "higher", 1.0, ("linear", "amplitude", "srgb"), ssim, smallest=2 * RADIUS + 1)
