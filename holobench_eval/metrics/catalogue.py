"""All metrics, in the order of the report's columns."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

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
