"""Structural similarity.

Z. Wang, A. C. Bovik, H. R. Sheikh, E. P. Simoncelli, "Image quality assessment: from error visibility to structural
similarity", IEEE Trans. Image Process. 13 (2004).
"""

from __future__ import annotations

import torch
from torch import Tensor

from .base import Metric, gaussian_valid, paired

SIGMA = 1.5
RADIUS = 5
C1 = 0.01**2
C2 = 0.03**2


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
    luminance, structure = LocalStatistics(y).maps(x)
    return (luminance * structure).mean(dim=(1, 2, 3)).reshape(image.shape[:-3])


SSIM = Metric("ssim", "1", "higher", 1.0, ("linear", "amplitude", "srgb"), ssim, smallest=2 * RADIUS + 1)
