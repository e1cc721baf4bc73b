"""Peak signal-to-noise ratio."""

from __future__ import annotations

from torch import Tensor
from torch.nn import functional

from .base import Metric, paired

FLOOR = 1e-8


def psnr(image: Tensor, target: Tensor) -> Tensor:
    """10 log10(1 / (mean squared error + 1e-8)), the peak being 1.

    The floor keeps the value and its gradient finite for identical images; at 30 dB it costs 4e-5 dB.

    Parameters
    ----------
    image, target
        ``(C, H, W)`` or ``(B, C, H, W)`` in [0, 1]; the mean goes over pixels and channels together.

    Returns
    -------
    Tensor
        Scalar or ``(B,)`` [dB]; higher is better, identical images give 80.

    Raises
    ------
    ValueError
        Wrong shapes, types or values; see ``base.paired``.

    Examples
    --------
    >>> import torch
    >>> float(psnr(torch.full((1, 8, 8), 0.6), torch.full((1, 8, 8), 0.5)).round(decimals=3))
    20.0
    """
    x, y = paired(image, target)
    error = functional.mse_loss(x, y, reduction="none").mean(dim=(1, 2, 3))
    return (-10 * (error + FLOOR).log10()).reshape(image.shape[:-3])


METRIC = Metric("psnr", "1", "higher", 80.0, ("linear", "amplitude", "srgb"), psnr, title="PSNR", unit="dB", digits=2)
