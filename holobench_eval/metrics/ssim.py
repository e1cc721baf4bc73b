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


def ssim_maps(x: Tensor, y: Tensor) -> tuple[Tensor, Tensor]:
    """Local SSIM (Eq. 13 of the paper) and its contrast-structure factor, (..., H, W) to two (..., H - 10, W - 10).

    Only pixels whose whole window lies in the image are kept.
    """
    moments = gaussian_valid(torch.stack([x, y, x.square() + y.square(), x * y]), SIGMA, RADIUS)
    mean_x, mean_y, squares, product = moments.unbind()
    mean_squares, mean_product = mean_x.square() + mean_y.square(), mean_x * mean_y
    structure = (2 * (product - mean_product) + C2) / (squares - mean_squares + C2)
    luminance = (2 * mean_product + C1) / (mean_squares + C1)
    return luminance * structure, structure


def ssim(image: Tensor, target: Tensor) -> Tensor:
    """Mean SSIM: 11-tap Gaussian window of sigma 1.5 px, K1 = 0.01, K2 = 0.03, data range 1, population covariance.

    It equals scikit-image's ``structural_similarity`` with ``gaussian_weights=True, sigma=1.5,
    use_sample_covariance=False, data_range=1``; channels are averaged.
    image, target: (C, H, W) or (B, C, H, W) in [0, 1], sides of at least 11 px.
    Returns a scalar or (B,); higher is better, at most 1. Raises ValueError (see ``paired``).
    """
    x, y = paired(image, target, smallest=2 * RADIUS + 1)
    return ssim_maps(x, y)[0].mean(dim=(1, 2, 3)).reshape(image.shape[:-3])


SSIM = Metric("ssim", "1", "higher", 1.0, ("linear", "amplitude", "srgb"), ssim, smallest=2 * RADIUS + 1)
