"""Gradient magnitude similarity deviation.

W. Xue, L. Zhang, X. Mou, A. C. Bovik, "Gradient magnitude similarity deviation: a highly efficient perceptual image
quality index", IEEE Trans. Image Process. 23 (2014).
"""

from __future__ import annotations

from torch import Tensor

from .base import Metric, gradient_magnitude, halved, mix, paired, safe_sqrt, similarity

LUMA = ((0.299, 0.587, 0.114),)
CONSTANT = 170 / 255**2


def gmsd(image: Tensor, target: Tensor) -> Tensor:
    """Standard deviation over the image of the similarity of Prewitt gradient magnitudes (Eq. 4-6 of the paper).

    Images are halved by 2x2 means first (an odd side is padded with zeros); colour is reduced to luma; c = 170 / 255^2.

    Parameters
    ----------
    image, target
        ``(C, H, W)`` or ``(B, C, H, W)`` in [0, 1], sRGB encoded, C = 1 or 3, sides of at least 2 px.

    Returns
    -------
    Tensor
        Scalar or ``(B,)``; lower is better, identical images give 0.

    Raises
    ------
    ValueError
        Wrong shapes, types or values; see ``base.paired``.
    """
    magnitudes = []
    for luma in paired(image, target, smallest=2):
        if luma.shape[1] == 3:
            luma = mix(luma, LUMA)
        magnitudes.append(gradient_magnitude(halved(luma), "prewitt"))
    a, b = magnitudes
    alike = similarity(a, b, CONSTANT)
    variance = (alike - alike.mean(dim=(1, 2, 3), keepdim=True)).square().mean(dim=(1, 2, 3))
    return safe_sqrt(variance).reshape(image.shape[:-3])


METRIC = Metric("gmsd", "1", "lower", 0.0, ("srgb",), gmsd, smallest=2, title="GMSD")
