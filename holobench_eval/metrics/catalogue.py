"""All metrics, in the order of the report's columns."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Literal

from .base import Metric
from .lpips import lpips_metric

# The files of this folder that hold a METRIC.
NAMES = ("psnr", "ssim", "ms_ssim", "feature_distance", "flip", "haarpsi", "gmsd", "mdsi", "fsim", "vsi")


def catalogue(lpips_weights: Path | None = None) -> tuple[Metric, ...]:
    """Every full-reference metric; those whose ``available()`` is not None cannot be computed here.

    lpips_weights: file or folder of the LPIPS trunk, default torch's hub cache.
    """
    fixed: list[Metric] = [import_module(f".{name}", __package__).METRIC for name in NAMES]
    return (*fixed, lpips_metric("alex", lpips_weights), lpips_metric("vgg", lpips_weights))


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
