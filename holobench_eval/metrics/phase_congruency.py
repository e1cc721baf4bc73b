"""Phase congruency of an image, the feature that FSIM compares.

P. Kovesi, "Image features from phase congruency", Videre 1 (1999); "Phase congruency detects corners and edges",
DICTA (2003).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import torch
from torch import Tensor

from .base import safe_sqrt

SCALES = 4
ORIENTATIONS = 4
MIN_LENGTH = 6.0
SCALE_RATIO = 2.0
SIGMA_F = 0.55
ANGULAR_RATIO = 1.2
NOISE_SIGMAS = 2.0
# Kovesi: the noise estimate is made for his first measure and is about this much too large for the second.
NOISE_EXCESS = 1.7


def frequency_grid(height: int, width: int) -> tuple[Tensor, Tensor]:
    """Centred row and column frequencies in cycles per pixel, (height, width) each, zero frequency in the middle.

    An odd side runs from -1/2 to 1/2, both included, as in Kovesi's own code.
    """
    rows, columns = (
        torch.arange(-(n - n % 2) / 2, (n + n % 2) / 2, dtype=torch.float64) / (n - n % 2 or 1) for n in (height, width)
    )
    grid = torch.meshgrid(rows, columns, indexing="ij")
    return grid[0], grid[1]


@dataclass(frozen=True)
class _Bank:
    """Log-Gabor filters (orientation, scale, H, W), and per orientation what the noise estimate needs of them."""

    filters: Tensor
    finest_power: Tensor
    noise_gain: Tensor


@lru_cache(maxsize=8)
def _bank(height: int, width: int, dtype: torch.dtype, device: torch.device) -> _Bank:
    rows, columns = frequency_grid(height, width)
    radius = torch.fft.ifftshift((rows.square() + columns.square()).sqrt())
    # The angle counts from the column axis; from the other axis only the highest frequency differs (1e-6 in FSIM).
    theta = torch.fft.ifftshift(torch.atan2(-columns, rows))
    radius[0, 0] = 1.0
    low_pass = 1 / (1 + (radius / 0.45).pow(30))
    radial = []
    for scale in range(SCALES):
        centre = 1 / (MIN_LENGTH * SCALE_RATIO**scale)
        gabor = torch.exp(-(radius / centre).log().square() / (2 * math.log(SIGMA_F) ** 2)) * low_pass
        gabor[0, 0] = 0.0
        radial.append(gabor)
    angular = []
    for orientation in range(ORIENTATIONS):
        angle = orientation * math.pi / ORIENTATIONS
        difference = torch.atan2((theta - angle).sin(), (theta - angle).cos())
        sigma = math.pi / ORIENTATIONS / ANGULAR_RATIO
        angular.append(torch.exp(-difference.square() / (2 * sigma**2)))
    filters = torch.stack(angular)[:, None] * torch.stack(radial)[None]
    kernels = torch.fft.ifft2(filters).real * math.sqrt(height * width)
    # Summed over space: squares of all filters, and products of all pairs of different scales.
    squares = kernels.square().sum(dim=(1, 2, 3))
    pairs = (kernels.sum(1).square().sum(dim=(1, 2)) - squares) / 2
    finest = filters[:, 0].square().sum(dim=(1, 2))
    gain = 2 * squares + 4 * pairs
    return _Bank(filters.to(device, dtype), finest.to(device, dtype), gain.to(device, dtype))


def phase_congruency(image: Tensor) -> Tensor:
    """Phase congruency summed over orientations, (B, 1, H, W) to (B, 1, H, W), in [0, 1].

    4 scales from a wavelength of 6 px, ratio 2, 4 orientations; noise threshold at 2 sigma of the Rayleigh
    distribution that the median of the finest responses implies.
    """
    bank = _bank(image.shape[-2], image.shape[-1], image.dtype, image.device)
    response = torch.fft.ifft2(torch.fft.fft2(image)[:, :, None] * bank.filters)
    real, imaginary = response.real.contiguous(), response.imag.contiguous()
    amplitude = safe_sqrt(real.square() + imaginary.square())  # abs() of complex numbers takes three times as long
    # Of the responses, the part in phase with their sum over scales, and what deviates from it.
    sum_real, sum_imaginary = real.sum(2), imaginary.sum(2)
    length = safe_sqrt(sum_real.square() + sum_imaginary.square()) + torch.finfo(image.dtype).eps
    cosine, sine = sum_real / length, sum_imaginary / length
    deviation = (imaginary * cosine[:, :, None] - real * sine[:, :, None]).abs()
    energy = sum_real * cosine + sum_imaginary * sine - deviation.sum(2)
    median = amplitude[:, :, 0].square().flatten(2).median(dim=-1).values
    noise_power = median / math.log(2) / bank.finest_power
    tau = safe_sqrt(noise_power * bank.noise_gain / 2)
    threshold = tau * (math.sqrt(math.pi / 2) + NOISE_SIGMAS * math.sqrt(2 - math.pi / 2)) / NOISE_EXCESS
    energy = (energy - threshold[..., None, None]).clamp_min(0)
    total = amplitude.sum(dim=(1, 2)) + torch.finfo(image.dtype).eps
    congruency: Tensor = energy.sum(1) / total
    return congruency[:, None]
