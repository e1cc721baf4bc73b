"""What a metric is, and the checks and small operations that all metrics share."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, wraps
from threading import Lock
from typing import Literal, TypeVar

import cv2
import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from ..core.graphs import is_recorded
from ..imaging.shifts import correlate, mirrored
from ..optics.linear import linear

Domain = Literal["linear", "amplitude", "srgb", "stored"]
"""Encodings of the images; ``stored``: values as pictures store them, whose relation to light is not known."""
Function = Callable[[Tensor, Tensor], Tensor]
T = TypeVar("T")

_TOLERANCE = 1e-6
_LARGEST_KEPT = 2**18


def always() -> str | None:
    """The answer of a metric that needs nothing but this package: no reason against it."""
    return None


@dataclass(frozen=True)
class Metric:
    """One full-reference image metric, called as ``function(image, target)``.

    Parameters
    ----------
    name
        In reports; the column is ``<name>_<domain>``.
    version
        Raised whenever a value would change.
    direction
        Whether a better image is higher or lower.
    best
        The value of identical images.
    domains
        The encodings of the images it is reported in: linear light, its square root, sRGB.
    function
        ``(C, H, W)`` or ``(B, C, H, W)`` twice, in [0, 1], to a scalar or ``(B,)``.
    smallest
        Shortest image side that it is defined for [px].
    available
        Why it cannot be computed here and what to do about it, or None.
    title
        In tables and figures; the name without underscores if it is empty.
    unit
        Empty for a pure number.
    digits
        Behind the decimal point, in tables.
    """

    name: str
    version: str
    direction: Literal["higher", "lower"]
    best: float
    domains: tuple[Domain, ...]
    function: Function
    smallest: int = 1
    available: Callable[[], str | None] = always
    title: str = ""
    unit: str = ""
    digits: int = 3

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of its scores of a capture, one a domain."""
        return tuple(f"{self.name}_{domain}" for domain in self.domains)


def paired(image: Tensor, target: Tensor, smallest: int = 1) -> tuple[Tensor, Tensor]:
    """Both images as (B, C, H, W), checked.

    image, target: (C, H, W) or (B, C, H, W), C = 1 or 3, float32 or float64, values in [0, 1].
    Raises ValueError for other shapes, types or values, for NaN, and for a side below ``smallest`` pixels. Nobody looks
    at the values on a GPU, where metrics are terms of a loss: it would keep steps from being recorded.
    """
    if image.shape != target.shape:
        raise ValueError(f"image {tuple(image.shape)} and target {tuple(target.shape)} differ in shape")
    if image.ndim not in (3, 4) or image.shape[-3] not in (1, 3):
        raise ValueError(f"expected (C, H, W) or (B, C, H, W) with C = 1 or 3, got {tuple(image.shape)}")
    if min(image.shape) == 0 or min(image.shape[-2:]) < smallest:
        raise ValueError(f"image sides must be at least {smallest} pixels, got {tuple(image.shape[-2:])}")
    if image.dtype != target.dtype or image.dtype not in (torch.float32, torch.float64):
        raise ValueError(f"expected two float32 or two float64 images, got {image.dtype} and {target.dtype}")
    looked_at = () if is_recorded(image.device) else (("image", image), ("target", target))
    for name, values in looked_at:
        low, high = (float(value) for value in values.detach().aminmax())
        if not (low >= -_TOLERANCE and high <= 1 + _TOLERANCE):
            raise ValueError(f"{name} values must be in [0, 1], got [{low:.6g}, {high:.6g}]")
    height, width = image.shape[-2:]
    channels = image.shape[-3]
    return image.reshape(-1, channels, height, width), target.reshape(-1, channels, height, width)


def remembered(function: Callable[[Tensor], T], most: int = 16) -> Callable[[Tensor], T]:
    """A function of one image whose last ``most`` results are kept, by what the image shows.

    For the features of targets, since many pictures are compared with one target. Nothing is kept with a gradient, in
    inference mode, for images of more than 2^18 values, whose features would fill the memory, and on other devices than
    the CPU.
    """
    kept: list[tuple[Tensor, T]] = []
    lock = Lock()

    @wraps(function)
    def known(image: Tensor) -> T:
        differentiated = image.requires_grad and torch.is_grad_enabled()
        if not image.is_cpu or image.numel() > _LARGEST_KEPT or differentiated or torch.is_inference_mode_enabled():
            return function(image)
        with lock:
            for index, (own, result) in enumerate(kept):
                if own.dtype == image.dtype and torch.equal(own, image):
                    kept.append(kept.pop(index))
                    return result
        own = image.detach().clone()
        result = function(own)
        with lock:
            kept.append((own, result))
            del kept[:-most]
        return result

    return known


def block_means(image: Tensor, k: int) -> Tensor:
    """Means over k x k pixels side by side, (B, C, H, W) to (B, C, H // k, W // k)."""
    return functional.avg_pool2d(image, k) if k > 1 else image  # torch takes long to average single pixels


def halved(image: Tensor) -> Tensor:
    """Means over 2 x 2 pixels, an odd side padded with zeros, (B, C, H, W) to (B, C, H / 2, W / 2)."""
    odd = max(image.shape[-2] % 2, image.shape[-1] % 2)
    return functional.avg_pool2d(functional.pad(image, (0, odd, 0, odd)), 2)


def safe_sqrt(x: Tensor) -> Tensor:
    """The square root of x >= 0, exact, with gradient zero (not infinity) where x is zero. Any shape."""
    if not x.requires_grad:
        return x.sqrt()
    positive = x > 0
    return torch.where(positive, torch.where(positive, x, 1.0).sqrt(), 0.0)


def similarity(a: Tensor, b: Tensor, constant: float) -> Tensor:
    """(2ab + c) / (a^2 + b^2 + c), the comparison of two feature maps that most metrics here share. Any shape."""
    return (2 * a * b + constant) / (a.square() + b.square() + constant)


def mix(image: Tensor, matrix: tuple[tuple[float, float, float], ...]) -> Tensor:
    """Linear combinations of the colour channels: (B, 3, H, W) to (B, len(matrix), H, W)."""
    return torch.einsum("ij,bjhw->bihw", _constant(matrix, image.dtype, image.device), image)


@lru_cache(maxsize=32)
@torch.inference_mode(False)  # in which it may be asked for first, and autograd could not use it
def _constant(matrix: tuple[tuple[float, ...], ...], dtype: torch.dtype, device: torch.device) -> Tensor:
    """A matrix on a device, brought there once: a GPU waits for each that Python brings."""
    return torch.tensor(matrix, dtype=dtype, device=device)


def as_rgb(image: Tensor) -> Tensor:
    """A gray image with its channel three times, a colour image as it is: (B, 1 or 3, H, W) to (B, 3, H, W)."""
    return image.expand(-1, 3, -1, -1)


def gradient_magnitude(image: Tensor, kernel: Literal["prewitt", "scharr"]) -> Tensor:
    """Length of the gradient of (B, 1, H, W), 3x3 Prewitt (/3) or Scharr (/16) operator, zeros outside the image."""
    middle = {"prewitt": 1 / 3, "scharr": 10 / 16}[kernel]
    side = {"prewitt": 1 / 3, "scharr": 3 / 16}[kernel]
    across = image.new_tensor([[side, 0, -side], [middle, 0, -middle], [side, 0, -side]])
    gradients = functional.conv2d(image, torch.stack([across, across.T])[:, None], padding=1)
    return safe_sqrt(gradients.square().sum(1, keepdim=True))


@lru_cache(maxsize=32)
def gaussian_taps(sigma: float, radius: int) -> tuple[float, ...]:
    """Weights of a Gaussian of width sigma [px] at -radius ... radius, of sum 1."""
    weights = [math.exp(-0.5 * (k / sigma) ** 2) for k in range(-radius, radius + 1)]
    return tuple(weight / sum(weights) for weight in weights)


def gaussian_valid(image: Tensor, sigma: float, radius: int) -> Tensor:
    """Gaussian filter of 2 radius + 1 taps where it fits wholly: (..., H, W) to (..., H - 2 radius, W - 2 radius)."""
    taps = gaussian_taps(sigma, radius)
    if image.is_cpu:  # by OpenCV: 20 times as fast at 1080x1920 as sums of shifted images
        ends = (len(taps) - 1,) * 4
        return linear(
            lambda x: _opencv_filtered(x, taps), lambda grad: _opencv_filtered(functional.pad(grad, ends), taps), image
        )
    return correlate(correlate(image, taps, dim=-1), taps, dim=-2)


def _opencv_filtered(image: Tensor, taps: Sequence[float]) -> Tensor:
    """Valid filter of (..., H, W) with symmetric taps along both axes, without a gradient."""
    radius, kernel = len(taps) // 2, np.array(taps)
    height, width = image.shape[-2:]
    result = image.new_empty((*image.shape[:-2], height - 2 * radius, width - 2 * radius))
    planes = zip(image.detach().reshape(-1, height, width), result.view(-1, *result.shape[-2:]), strict=True)
    for plane, result_plane in planes:
        filtered = cv2.sepFilter2D(plane.numpy(), -1, kernel, kernel)
        result_plane.copy_(torch.from_numpy(filtered[radius : height - radius, radius : width - radius]))
    return result


def gaussian_blur(image: Tensor, sigma: float) -> Tensor:
    """Gaussian filter of width sigma [px], cut off at 4 sigma, mirrored at the edges: (B, C, H, W) to the same."""
    radius = math.ceil(4 * sigma)
    return gaussian_valid(mirrored(image, radius), sigma, radius)
