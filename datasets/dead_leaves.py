"""Dead leaves: generated images with the edges and the scale invariance of photographs, for training."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import cv2
import numpy as np
import torch
from annotated_types import Interval
from torch import Tensor

from ..core.seeds import generator
from ..optics import srgb_decode
from .base import known, named_digest, planes, with_channels

VERSION = 1  # part of every digest: raise it when the images are drawn differently

# radius [px] where the power law begins. The power spectrum then falls as f^-2.4; with 1 px as f^-2, with too much
# fine detail beside photographs of this size (f^-2.8, the median over those of `photographs`).
SMALLEST_RADIUS = 2.0

LARGEST_RADIUS = 0.3  # radius where the power law ends, as a fraction of the short side

LAYERS = 9.0  # summed area of all discs over the area they fall on: a pixel is left bare with probability exp(-9)

# Mean (R, G, B) and standard deviation of photographs in sRGB: those of ImageNet, which agree over the channels within
# 0.005; https://docs.pytorch.org/vision/stable/models.html. How much of it the channels do not share is assumed.
NATURAL_MEAN, NATURAL_DEVIATION, OWN_DEVIATION = (0.485, 0.456, 0.406), 0.225, 0.08

Colours = Literal["uniform", "natural"]
SAMPLES = 2  # samples a pixel and axis, so that edges are smooth


@dataclass(frozen=True)
class DeadLeaves:
    """Generated images for training: discs that cover one another, of all sizes and colours.

    The dead-leaves model of Lee, Mumford & Huang, "Occlusion models for natural images", Int. J. Comput. Vis. 41, 35-59
    (2001): discs fall at random places, the later ones in front; radii have the density r^-3, under which the image is
    scale invariant, from 2 px to 0.3 of the short side. A disc has one colour: a gray level and a deviation of each
    channel from it, since the channels of photographs go mostly together. They are drawn for the shape asked for, not
    resized.

    count: how many images; seed: another number gives other images; colours: "uniform", gray levels uniform in sRGB,
    with more contrast than photographs have, or "natural", with the mean and standard deviation of the photographs in
    ImageNet, before clipping.
    """

    count: Annotated[int, Interval(ge=1, le=100_000)] = 24
    seed: Annotated[int, Interval(ge=0)] = 0
    colours: Colours = "uniform"

    training: ClassVar[bool] = True

    def items(self) -> list[str]:
        """``leaves-000``, ``leaves-001`` ..."""
        return [f"leaves-{index:03d}" for index in range(self.count)]

    def load(self, item: str, shape: tuple[int, int], channels: int = 3) -> Tensor:
        """An image as ``(channels, *shape)`` linear light in [0, 1]; the same for the same seed, item and shape."""
        draw = generator("dead leaves", self.seed, known("dead-leaves image", item, self.items()))
        return with_channels(_leaves(shape, draw, self.colours), channels)

    def digest(self, item: str) -> str:
        """SHA-256 of the seed, the item's name and the version of the generator."""
        drawn = () if self.colours == "uniform" else (self.colours,)
        return named_digest("dead leaves", VERSION, self.seed, known("dead-leaves image", item, self.items()), *drawn)


def radii(count: int, smallest: float, largest: float, draw: torch.Generator) -> Tensor:
    """``(count,)`` radii with a density proportional to r^-3 between the two, by inversion of its integral."""
    uniform = torch.rand(count, generator=draw, dtype=torch.float64)
    return (smallest**-2 - uniform * (smallest**-2 - largest**-2)).rsqrt()


def _leaves(shape: tuple[int, int], draw: torch.Generator, colours: Colours) -> Tensor:
    """``(3, h, w)`` linear light: the discs, painted from the back to the front."""
    size = torch.tensor(shape, dtype=torch.float64)
    smallest, largest = SMALLEST_RADIUS, max(LARGEST_RADIUS * min(shape), 2 * SMALLEST_RADIUS)
    # Centres fall up to the largest radius outside, so that the border looks like the middle.
    area = float((size + 2 * largest).prod())
    mean_disc = 2 * math.pi * math.log(largest / smallest) / (smallest**-2 - largest**-2)
    count = math.ceil(LAYERS * area / mean_disc)
    radius = radii(count, smallest, largest, draw)
    centre = torch.rand(count, 2, generator=draw, dtype=torch.float64) * (size + 2 * largest) - largest
    colour = COLOURS[colours](count, draw)
    nearest = centre.clamp(torch.zeros(2, dtype=torch.float64), size)
    seen = (centre - nearest).norm(dim=1) < radius
    canvas = np.empty((shape[0] * SAMPLES, shape[1] * SAMPLES, 3), dtype=np.float32)
    canvas[:] = colour[0].tolist()
    # OpenCV counts from the centre of the first pixel, in 1/16 px with shift=4.
    places = ((centre * SAMPLES - 0.5) * 16).round().int().tolist()
    sizes = (radius * SAMPLES * 16).round().int().tolist()
    painted = colour.tolist()
    for index in seen.nonzero()[:, 0].tolist():
        y, x = places[index]
        cv2.circle(canvas, (x, y), sizes[index], painted[index], thickness=cv2.FILLED, shift=4)
    image = planes(canvas)
    return torch.nn.functional.avg_pool2d(image, SAMPLES).clamp(0.0, 1.0)


def _uniform(count: int, draw: torch.Generator) -> Tensor:
    """Colours ``(count, 3)``, linear light: gray levels uniform in sRGB, and a deviation of 0.12."""
    gray = torch.rand(count, 1, generator=draw, dtype=torch.float64)
    deviation = torch.randn(count, 3, generator=draw, dtype=torch.float64)
    return srgb_decode(gray + 0.12 * deviation)


def _natural(count: int, draw: torch.Generator) -> Tensor:
    """Colours ``(count, 3)``, linear light, with the statistics of photographs."""
    gray = torch.randn(count, 1, generator=draw, dtype=torch.float64)
    own = torch.randn(count, 3, generator=draw, dtype=torch.float64)
    shared = math.sqrt(NATURAL_DEVIATION**2 - OWN_DEVIATION**2)
    return srgb_decode(torch.tensor(NATURAL_MEAN, dtype=torch.float64) + shared * gray + OWN_DEVIATION * own)


COLOURS = {"uniform": _uniform, "natural": _natural}
