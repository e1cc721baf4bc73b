"""Generated pictures that are scored beside photographs, each of one kind of scene and drawn from its name."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
import torch
from torch import Tensor

from .base import LUMINANCE, planes
from .scenes import landscape, stones, street, table
from .seeded import Array, Seeded

VERSION = 1  # part of every digest: raise it when a scene is drawn or exposed differently

SCENES: dict[str, Callable[[Seeded, Array, Array], Array]] = {
    "landscape": landscape,
    "street": street,
    "table": table,
    "stones": stones,
}

SAMPLES = 2  # samples a pixel and axis, so that edges are smooth

# Mean light, and deviation of luminance as a share of it, uniform between these. In the middle crops of the photographs
# of ``crops``, the Hubble Deep Field apart, they are 0.13 to 0.29 (mean 0.20) and 0.37 to 1.27 (mean 0.82).
MEAN, CONTRAST = (0.08, 0.34), (0.4, 1.1)
POWER = 0.6, 2.5  # of the luminance that film sees: how soft and how hard a picture may be developed


@lru_cache(maxsize=64)
def rendering(name: str, shape: tuple[int, int]) -> Tensor:
    """``(3, *shape)`` linear light in [0, 1]; its name, ``kind-number``, seeds it."""
    rows, columns = (size * SAMPLES for size in shape)
    y, x = ((np.arange(size) + 0.5 - size / 2) / rows for size in (rows, columns))
    across, down = np.meshgrid(x, y)
    draw = Seeded("rendering", name)
    radiance = SCENES[name.rsplit("-", 1)[0]](draw, across, -down)
    fine = torch.nn.functional.avg_pool2d(planes(radiance.astype(np.float32)), SAMPLES)
    mean = draw.number(*MEAN)
    return exposed(fine, mean, mean * draw.number(*CONTRAST))


def exposed(radiance: Tensor, mean: float, deviation: float) -> Tensor:
    """As a camera shows light: 1 - exp(-gain luminance^power) of the mean and, if in reach, the deviation given.

    Colours keep their ratios until film saturates.
    """
    weights = torch.tensor(LUMINANCE)
    luminance = torch.einsum("c,chw->hw", weights, radiance).clamp_min(1e-9)
    ratios, step = radiance / luminance, max(1, radiance.shape[-1] // 100)

    def film(power: float, gain: float, step: int = 1) -> Tensor:
        light = (power * luminance[::step, ::step].log() + gain).exp()
        return 1 - (-light * ratios[:, ::step, ::step]).exp()

    def gain(power: float) -> float:
        """Logarithm of the gain that gives the mean."""
        low, high = -15.0, 15.0
        for _ in range(20):
            middle = (low + high) / 2
            low, high = (middle, high) if float(film(power, middle, step).mean()) < mean else (low, middle)
        return (low + high) / 2

    low, high = POWER
    for _ in range(10):
        power = (low + high) / 2
        contrast = torch.einsum("c,chw->hw", weights, film(power, gain(power), step)).std()
        low, high = (power, high) if float(contrast) < deviation else (low, power)
    return film(power, gain(power)).clamp(0, 1)
