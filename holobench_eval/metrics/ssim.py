"""Structural similarity.

Z. Wang, A. C. Bovik, H. R. Sheikh, E. P. Simoncelli, "Image quality assessment: from error visibility to structural
similarity", IEEE Trans. Image Process. 13 (2004).
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from itertools import product

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from .base import Metric, gaussian_taps, gaussian_valid, paired

SIGMA = 1.5
RADIUS = 5
C1 = 0.01**2
C2 = 0.03**2
STRIP = 2**17  # pixels that are compared together: few enough to stay in the cache
LARGE = 2**20  # pixels for each thread; to start a thread takes as long as to compare a tenth of them

Plane = NDArray[np.floating]


class LocalStatistics:
    """Local mean and variance of an image (..., H, W), to compare others with: its windows are filtered once.

    Maps are (..., H - 10, W - 10): only pixels whose whole window lies in the image are kept.
    """

    def __init__(self, image: Tensor) -> None:
        self.image = image

    @cached_property
    def _moments(self) -> tuple[Tensor, Tensor, Tensor]:
        """Mean, its square, variance."""
        mean, squares = gaussian_valid(torch.stack([self.image, self.image.square()]), SIGMA, RADIUS).unbind()
        mean_squared = mean.square()
        return mean, mean_squared, squares - mean_squared

    def maps(self, other: Tensor) -> tuple[Tensor, Tensor]:
        """Luminance and contrast-structure factor of the SSIM (Eq. 6, and 9 with 10, of the paper) of another image."""
        own_mean, own_mean_squared, own_variance = self._moments
        moments = gaussian_valid(torch.stack([other, other.square(), other * self.image]), SIGMA, RADIUS)
        mean, squares, products = moments.unbind()
        mean_squared, mean_product = mean.square(), mean * own_mean
        structure = (2 * (products - mean_product) + C2) / (squares - mean_squared + own_variance + C2)
        luminance = (2 * mean_product + C1) / (mean_squared + own_mean_squared + C1)
        return luminance, structure

    def means(self, other: Tensor) -> tuple[Tensor, Tensor]:
        """Means of the SSIM and of its contrast-structure factor over channels and windows, (B, C, H, W) to (B,)."""
        differentiated = torch.is_grad_enabled() and (other.requires_grad or self.image.requires_grad)
        if other.is_cpu and not differentiated:
            return _means(other, self.image)
        luminance, structure = self.maps(other)
        return (luminance * structure).mean(dim=(1, 2, 3)), structure.mean(dim=(1, 2, 3))


def ssim(image: Tensor, target: Tensor) -> Tensor:
    """Mean SSIM: 11-tap Gaussian window of sigma 1.5 px, K1 = 0.01, K2 = 0.03, data range 1, population covariance.

    It equals scikit-image's ``structural_similarity`` with ``gaussian_weights=True, sigma=1.5,
    use_sample_covariance=False, data_range=1``; channels are averaged.

    Parameters
    ----------
    image, target
        ``(C, H, W)`` or ``(B, C, H, W)`` in [0, 1], sides of at least 11 px.

    Returns
    -------
    Tensor
        Scalar or ``(B,)``; higher is better, identical images give 1.

    Raises
    ------
    ValueError
        Wrong shapes, types or values; see ``base.paired``.

    Examples
    --------
    >>> picture = torch.linspace(0, 1, 256).view(1, 16, 16)
    >>> float(ssim(picture, picture))
    1.0
    """
    x, y = paired(image, target, smallest=2 * RADIUS + 1)
    return LocalStatistics(y).means(x)[0].reshape(image.shape[:-3])


def _means(image: Tensor, target: Tensor) -> tuple[Tensor, Tensor]:
    """``LocalStatistics.means`` without a gradient, on a CPU: strip by strip, in threads where that pays."""
    batch, channels, height, width = image.shape
    planes = [side.detach().reshape(-1, height, width).numpy() for side in (image, target)]
    inner = height - 2 * RADIUS
    step = max(2 * RADIUS, STRIP // width)
    strips = list(product(range(batch * channels), range(0, inner, step)))

    def sums(strip: tuple[int, int]) -> tuple[float, float]:
        plane, first = strip
        rows = slice(first, min(first + step, inner) + 2 * RADIUS)
        return _sums(planes[0][plane, rows], planes[1][plane, rows])

    # Strips do not depend on the number of threads, and are added in their order: nor does the value.
    threads = min(torch.get_num_threads(), math.ceil(image.numel() / LARGE))
    if threads > 1:
        with ThreadPoolExecutor(threads) as pool:
            totals = list(pool.map(sums, strips))
    else:
        totals = [sums(strip) for strip in strips]
    added = np.array(totals).reshape(batch, -1, 2).sum(1) / (channels * inner * (width - 2 * RADIUS))
    full, structure = torch.from_numpy(added).to(image.dtype).unbind(1)
    return full, structure


def _sums(x: Plane, y: Plane) -> tuple[float, float]:
    """Sums over the windows in a strip (h, W) of two images of the SSIM and of its contrast-structure factor.

    The SSIM has only the sum of the two variances, so that four filters do.
    """
    mean_x, mean_y, squares, products = (_strip_filtered(side) for side in (x, y, x * x + y * y, x * y))
    mean_squares, mean_products = mean_x * mean_x + mean_y * mean_y, mean_x * mean_y
    structure = (2 * (products - mean_products) + C2) / (squares - mean_squares + C2)
    luminance = (2 * mean_products + C1) / (mean_squares + C1)
    return float((luminance * structure).sum(dtype=np.float64)), float(structure.sum(dtype=np.float64))


def _strip_filtered(plane: Plane) -> Plane:
    """``gaussian_valid`` of one plane."""
    taps = np.array(gaussian_taps(SIGMA, RADIUS))
    return np.asarray(cv2.sepFilter2D(plane, -1, taps, taps)[RADIUS:-RADIUS, RADIUS:-RADIUS], dtype=plane.dtype)


METRIC = Metric("ssim", "1", "higher", 1.0, ("linear", "amplitude", "srgb"), ssim, 2 * RADIUS + 1, title="SSIM")
