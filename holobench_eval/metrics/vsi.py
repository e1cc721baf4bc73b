"""Visual saliency-induced index.

L. Zhang, Y. Shen, H. Li, "VSI: a visual saliency-induced index for perceptual image quality assessment", IEEE Trans.
Image Process. 23 (2014); the saliency is that of L. Zhang, Z. Gu, H. Li, "SDSP: a novel saliency detection method by
combining simple priors", ICIP (2013).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import torch
from torch import Tensor
from torch.nn import functional

from ..optics.colour import srgb_decode
from .base import Metric, as_rgb, block_means, gradient_magnitude, mix, paired, remembered, safe_sqrt, similarity
from .phase_congruency import frequency_grid

LMN = ((0.06, 0.63, 0.27), (0.30, 0.04, -0.35), (0.34, -0.60, 0.17))
# Linear sRGB to CIE XYZ (D65 primaries, IEC 61966-2-1), and the white that Lab is taken against (D50, 2 degrees).
XYZ = (
    (0.4124564, 0.3575761, 0.1804375),
    (0.2126729, 0.7151522, 0.0721750),
    (0.0193339, 0.1191920, 0.9503041),
)
WHITE = (0.9642119944211994, 1.0, 0.8251882845188288)
C1, C2, C3 = 1.27, 386.0, 130.0
ALPHA, BETA = 0.4, 0.02
OMEGA_0, SIGMA_F, SIGMA_D, SIGMA_C = 0.021, 1.34, 145.0, 0.001
SALIENCY_SIDE = 256


def _lab(rgb: Tensor) -> Tensor:
    """CIE L*a*b* of sRGB values in [0, 1], (B, 3, H, W)."""
    xyz = mix(srgb_decode(rgb), XYZ) / rgb.new_tensor(WHITE).view(3, 1, 1)
    f = torch.where(xyz > 0.008856, xyz.clamp_min(0.008856).pow(1 / 3), (903.3 * xyz + 16) / 116)
    fx, fy, fz = f.unbind(1)
    return torch.stack([116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz)], dim=1)


@lru_cache(maxsize=4)
def _priors(dtype: torch.dtype, device: torch.device) -> tuple[Tensor, Tensor]:
    """The log-Gabor filter (uncentred) and the prior for the centre of the picture, (256, 256) each."""
    rows, columns = frequency_grid(SALIENCY_SIDE, SALIENCY_SIDE)
    radius = (rows.square() + columns.square()).sqrt()
    radius = torch.fft.ifftshift(torch.where(radius <= 0.5, radius, 0.0))
    gabor = torch.where(radius > 0, torch.exp(-(radius / OMEGA_0).log().square() / (2 * SIGMA_F**2)), 0.0)
    offset = (rows * SALIENCY_SIDE + 1).square() + (columns * SALIENCY_SIDE + 1).square()
    return gabor.to(device, dtype), torch.exp(-offset / SIGMA_D**2).to(device, dtype)


def _reduced(image: Tensor) -> Tensor:
    """(B, C, H, W) averaged over k x k pixels, k = shorter side / 256 rounded, after the edges are repeated.

    The padding is k - 1 in all; for even k the longer one is before the image, unlike in MDSI.
    """
    k = max(1, round(min(image.shape[-2:]) / 256))
    before, after = k // 2, (k - 1) // 2
    return block_means(functional.pad(image, (before, after, before, after), mode="replicate"), k)


def _unit_range(x: Tensor) -> Tensor:
    """Each plane of (B, C, H, W) mapped linearly to [0, 1]; a flat plane to 0."""
    low, high = x.amin(dim=(2, 3), keepdim=True), x.amax(dim=(2, 3), keepdim=True)
    return (x - low) / (high - low + torch.finfo(x.dtype).eps)


def _priors_multiplied(small: Tensor) -> Tensor:
    """Frequency, location and warm-colour priors of (B, 3, 256, 256) multiplied, (B, 1, 256, 256)."""
    lab = _lab(small)
    gabor, centre = _priors(small.dtype, small.device)
    frequency = safe_sqrt(torch.fft.ifft2(torch.fft.fft2(lab) * gabor).real.square().sum(1, keepdim=True))
    warmth = _unit_range(lab[:, 1:]).square().sum(1, keepdim=True)
    # From 50 on the result is 1, and exp takes ten times as long where it underflows.
    colour = 1 - torch.exp(-(warmth / SIGMA_C**2).clamp_max(50))
    return frequency * centre * colour


_priors_of_target = remembered(_priors_multiplied)  # of a large one, too


def _saliency(rgb: Tensor, of_small: Callable[[Tensor], Tensor]) -> Tensor:
    """SDSP saliency, (B, 3, H, W) in [0, 1] to (B, 1, H, W); of_small: that of 256 x 256 pixels."""
    small = functional.interpolate(rgb, (SALIENCY_SIDE, SALIENCY_SIDE), mode="bilinear", align_corners=False)
    return _unit_range(functional.interpolate(of_small(small), rgb.shape[-2:], mode="bilinear", align_corners=True))


_saliency_of_target = remembered(lambda rgb: _saliency(rgb, _priors_of_target))


def vsi(image: Tensor, target: Tensor) -> Tensor:
    """Similarity of saliency, Scharr gradient and chroma, weighted by saliency (Eq. 6-10 of the paper).

    Values in [0, 255], colours as LMN; C1 = 1.27, C2 = 386, C3 = 130, alpha = 0.4, beta = 0.02; images are averaged
    over k x k pixels after the saliency is taken, k = shorter side / 256 rounded.

    Parameters
    ----------
    image, target
        ``(C, H, W)`` or ``(B, C, H, W)`` in [0, 1], sRGB encoded, C = 1 or 3, sides of at least 3 px; gray
        is taken as three equal channels.

    Returns
    -------
    Tensor
        Scalar or ``(B,)``; higher is better, identical images give 1.

    Raises
    ------
    ValueError
        Wrong shapes, types or values; see ``base.paired``.
    """
    x, y = (as_rgb(side) for side in paired(image, target, smallest=3))
    salience_x, salience_y = _reduced(_saliency(x, _priors_multiplied)), _reduced(_saliency_of_target(y))
    x, y = (mix(_reduced(255 * side), LMN) for side in (x, y))
    chroma = similarity(x[:, 1:2], y[:, 1:2], C3) * similarity(x[:, 2:], y[:, 2:], C3)
    # The real part of a complex power, since the product may be negative.
    sign = torch.where(chroma < 0, math.cos(BETA * math.pi), 1.0).to(chroma)
    chroma = chroma.abs().clamp_min(1e-12).pow(BETA) * sign
    gradient = similarity(gradient_magnitude(x[:, :1], "scharr"), gradient_magnitude(y[:, :1], "scharr"), C2)
    alike = similarity(salience_x, salience_y, C1) * gradient.pow(ALPHA) * chroma
    weights = torch.maximum(salience_x, salience_y)
    eps = torch.finfo(weights.dtype).eps
    value = ((alike * weights).sum(dim=(1, 2, 3)) + eps) / (weights.sum(dim=(1, 2, 3)) + eps)
    return value.reshape(image.shape[:-3])


METRIC = Metric("vsi", "1", "higher", 1.0, ("srgb",), vsi, smallest=3, title="VSI")
