"""All metrics, in the order of the report's columns."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from .base import Metric
from .feature_distance import MOFD
from .flip import FLIP
from .fsim import FSIM
from .gmsd import GMSD
from .haarpsi import HAARPSI
from .lpips import lpips_metric
from .mdsi import MDSI
from .ms_ssim import MS_SSIM
from .psnr import PSNR
from .ssim import SSIM
from .vsi import VSI

_FIXED = (PSNR, SSIM, MS_SSIM, MOFD, FLIP, HAARPSI, GMSD, MDSI, FSIM, VSI)


def catalogue(lpips_weights: Path | None = None) -> tuple[Metric, ...]:
    """Every full-reference metric; those whose ``available()`` is not None cannot be computed here.

    lpips_weights: file or folder of the LPIPS trunk, default torch's hub cache.
    """
    return (*_FIXED, lpips_metric("alex", lpips_weights), lpips_metric("vgg", lpips_weights))


def direction(column: str) -> Literal["higher", "lower"] | None:
    """Whether a column of ``score`` is better higher or lower; None for those that only describe the capture."""
    if column == "speckle_contrast":
        return "lower"
    for metric in catalogue():
        for domain in (*metric.domains, "stored"):
            stem = f"{metric.name}_{domain}"
            if column in (stem, f"{stem}_refined") or column.startswith(f"{stem}_blur"):
                return metric.direction
    return None
