"""Structural similarity.

Z. Wang, A. C. Bovik, H. R. Sheikh, E. P. Simoncelli, "Image quality assessment: from error visibility to structural
similarity", IEEE Trans. Image Process. 13 (2004).
"""

from __future__ import annotations

from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ..core.compiled import compiled, usable
from ..optics.blocks import in_blocks
from .base import Metric, gaussian_taps, gaussian_valid, paired

SIGMA = 1.5
RADIUS = 5
C1 = 0.01**2
C2 = 0.03**2
STRIP = 2**17  # pixels that are compared together: few enough to stay in the cache

Plane = NDArray[np.floating]
TAPS: Plane = np.array(gaussian_taps(SIGMA, RADIUS))


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
        if usable(other, self.image):
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
    >>> picture = torch.linspace(0, 1, 256, dtype=torch.float64).view(1, 16, 16)
    >>> round(float(ssim(picture, picture)), 6)
    1.0
    """
    x, y = paired(image, target, smallest=2 * RADIUS + 1)
    return LocalStatistics(y).means(x)[0].reshape(image.shape[:-3])


def _means(image: Tensor, target: Tensor) -> tuple[Tensor, Tensor]:
    """``LocalStatistics.means``, compiled: strip by strip, in threads where that pays."""
    batch, channels, height, width = image.shape
    planes = [side.detach().contiguous().view(-1, height, width).numpy() for side in (image, target)]
    inner = height - 2 * RADIUS
    step = max(2 * RADIUS, STRIP // width)
    strips = list(product(range(batch * channels), range(0, inner, step)))
    totals = np.empty((len(strips), 2))

    def compare(some: slice) -> None:
        for index in range(len(strips))[some]:
            plane, first = strips[index]
            rows = slice(first, min(first + step, inner) + 2 * RADIUS)
            totals[index] = _sums(planes[0][plane, rows], planes[1][plane, rows], TAPS)

    # Strips do not depend on the number of threads, and are added in their order: nor does the value.
    in_blocks(compare, image, len(strips), image.numel())
    added = totals.reshape(batch, -1, 2).sum(1) / (channels * inner * (width - 2 * RADIUS))
    full, structure = torch.from_numpy(added).to(image.dtype).unbind(1)
    return full, structure


@compiled
def _factors(mean_x: Any, mean_y: Any, squares: Any, products: Any) -> tuple[Any, Any]:
    """Contrast-structure factor and SSIM from the filtered images, the sum of their squares and their product."""
    mean_squares, mean_products = mean_x * mean_x + mean_y * mean_y, mean_x * mean_y
    structure = (2 * (products - mean_products) + C2) / (squares - mean_squares + C2)
    return structure, structure * (2 * mean_products + C1) / (mean_squares + C1)


@compiled
def _sums(x: Plane, y: Plane, taps: Plane) -> tuple[float, float]:
    """Sums over the windows in a strip (h, W) of two images of the SSIM and of its contrast-structure factor: each row
    of windows in one pass, down its columns, then along what they gave.

    The SSIM has only the sum of the two variances, so that four filters do. A window is symmetric: two pixels at a
    time have one weight.
    """
    width = x.shape[1]
    inner = width - 2 * RADIUS
    means_x, means_y, squares, products = np.empty(width), np.empty(width), np.empty(width), np.empty(width)
    entire, structure = np.zeros(inner), np.zeros(inner)
    for row in range(RADIUS, x.shape[0] - RADIUS):
        for c in range(width):
            u, v, t = x[row, c], y[row, c], taps[RADIUS]
            a, b, s, p = t * u, t * v, t * (u * u + v * v), t * (u * v)
            for k in range(1, RADIUS + 1):
                t = taps[RADIUS + k]
                u, v, du, dv = x[row - k, c], y[row - k, c], x[row + k, c], y[row + k, c]
                a += t * (u + du)
                b += t * (v + dv)
                s += t * (u * u + v * v + (du * du + dv * dv))
                p += t * (u * v + du * dv)
            means_x[c], means_y[c], squares[c], products[c] = a, b, s, p
        for c in range(inner):
            m, t = c + RADIUS, taps[RADIUS]
            a, b, s, p = t * means_x[m], t * means_y[m], t * squares[m], t * products[m]
            for k in range(1, RADIUS + 1):
                t = taps[RADIUS + k]
                a += t * (means_x[m - k] + means_x[m + k])
                b += t * (means_y[m - k] + means_y[m + k])
                s += t * (squares[m - k] + squares[m + k])
                p += t * (products[m - k] + products[m + k])
            contrast, similarity = _factors(a, b, s, p)
            entire[c] += similarity
            structure[c] += contrast
    return entire.sum(), structure.sum()


METRIC = Metric("ssim", "1", "higher", 1.0, ("linear", "amplitude", "srgb"), ssim, 2 * RADIUS + 1, title="SSIM")
