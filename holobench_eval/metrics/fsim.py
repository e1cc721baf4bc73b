"""Feature similarity index.

L. Zhang, L. Zhang, X. Mou, D. Zhang, "FSIM: a feature similarity index for image quality assessment", IEEE Trans. Image
Process. 20 (2011).
"""

from __future__ import annotations

import torch
from torch import Tensor

from .base import Metric, block_means, gradient_magnitude, mix, paired, remembered, similarity
from .haarpsi import YIQ
from .phase_congruency import phase_congruency

T1, T2, T3, T4 = 0.85, 160.0, 200.0, 200.0
CHROMA_EXPONENT = 0.03

_congruency_of_target = remembered(phase_congruency)


def fsim(image: Tensor, target: Tensor) -> Tensor:
    """Similarity of phase congruency and Scharr gradients, weighted by phase congruency (Eq. 4-10 of the paper).

    A colour image gets FSIMc, the form with the I and Q channels of YIQ; a gray image FSIM. Values in [0, 255]; images
    are averaged over k x k pixels first, k = shorter side / 256 rounded; T1 = 0.85, T2 = 160, T3 = T4 = 200,
    lambda = 0.03.

    Parameters
    ----------
    image, target
        ``(C, H, W)`` or ``(B, C, H, W)`` in [0, 1], sRGB encoded, C = 1 or 3, sides of at least 16 px.

    Returns
    -------
    Tensor
        Scalar or ``(B,)``; higher is better, identical images give 1.

    Raises
    ------
    ValueError
        Wrong shapes, types or values; see ``base.paired``.
    """
    x, y = paired(image, target, smallest=16)
    k = max(1, round(min(x.shape[-2:]) / 256))
    x, y = (block_means(255 * side, k) for side in (x, y))
    if x.shape[1] == 3:
        x, y = mix(x, YIQ), mix(y, YIQ)
    congruency_x, congruency_y = phase_congruency(x[:, :1]), _congruency_of_target(y[:, :1])
    alike = similarity(congruency_x, congruency_y, T1) * similarity(
        gradient_magnitude(x[:, :1], "scharr"), gradient_magnitude(y[:, :1], "scharr"), T2
    )
    if x.shape[1] == 3:
        chroma = similarity(x[:, 1:2], y[:, 1:2], T3) * similarity(x[:, 2:], y[:, 2:], T4)
        alike = alike * chroma.abs().clamp_min(1e-12).pow(CHROMA_EXPONENT)
    weights = torch.maximum(congruency_x, congruency_y)
    total = weights.sum(dim=(1, 2, 3))
    # Two images without any feature have nothing to tell them apart.
    empty = total == 0
    value = (alike * weights).sum(dim=(1, 2, 3)) / torch.where(empty, 1.0, total)
    return torch.where(empty, 1.0, value).reshape(image.shape[:-3])


METRIC = Metric("fsim", "1", "higher", 1.0, ("srgb",), fsim, smallest=16, title="FSIM")
