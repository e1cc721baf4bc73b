"""What every dataset offers, and how an image becomes a target: linear light, cropped to the aspect, resized."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import ClassVar, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image
from torch import Tensor

from ..core.errors import UserError, suggest
from ..optics import srgb_decode

LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Weights of linear R, G, B in relative luminance (ITU-R BT.709-6, section 3.2)."""


class Dataset(Protocol):
    """A frozen dataclass of parameters; ``training`` marks images that methods may train on and nothing may score."""

    training: ClassVar[bool]

    def items(self) -> list[str]:
        """The names of the images, unique, in a fixed order. UserError for a source that cannot be used."""
        ...

    def load(self, item: str, shape: tuple[int, int], channels: int = 3) -> Tensor:
        """An image as ``(channels, *shape)`` linear light in [0, 1], float32."""
        ...

    def digest(self, item: str) -> str:
        """SHA-256 (hexadecimal) of what the image is made from; it changes when the image does."""
        ...


def fit(image: Tensor, shape: tuple[int, int], resampling: Image.Resampling = Image.Resampling.BILINEAR) -> Tensor:
    """The largest centred part of an image that has the aspect of ``shape``, resized to it; never a stretch.

    image: ``(C, H, W)`` linear light in [0, 1]; shape: ``(h, w)`` px. Returns ``(C, h, w)`` float32 in [0, 1].

    The crop is not rounded to pixels, so that both axes are scaled by the same factor exactly. The filter is a
    triangle as wide as two output pixels (two input pixels where the image is too small and has to be enlarged):
    its weights are positive, so nothing rings and the result needs no clipping. ``resampling``: another of Pillow's.
    """
    rows, columns = shape
    height, width = image.shape[-2:]
    scale = min(height / rows, width / columns)
    top, left = (height - rows * scale) / 2, (width - columns * scale) / 2
    # Rounding must not reach past the border by the last bit, which Pillow refuses.
    box = (max(left, 0.0), max(top, 0.0), min(left + columns * scale, width), min(top + rows * scale, height))
    resized = [
        np.asarray(Image.fromarray(plane).resize((columns, rows), resampling, box=box))
        for plane in image.to(torch.float32).numpy()
    ]
    return torch.from_numpy(np.stack(resized)).clamp_(0.0, 1.0)


def from_srgb(pixels: NDArray[np.uint8] | NDArray[np.uint16]) -> Tensor:
    """``(H, W)`` or ``(H, W, 3)`` sRGB levels of 8 or 16 bits as ``(3, H, W)`` linear light; gray is replicated."""
    levels = np.iinfo(pixels.dtype).max + 1
    table = srgb_decode(torch.arange(levels, dtype=torch.float64) / (levels - 1)).float().numpy()
    return planes(table[pixels])


def planes(image: NDArray[np.float32]) -> Tensor:
    """``(H, W)`` or ``(H, W, 3)`` as ``(3, H, W)``; gray is replicated."""
    colour = np.broadcast_to(image[..., None], (*image.shape, 3)) if image.ndim == 2 else image
    return torch.from_numpy(np.ascontiguousarray(colour.transpose(2, 0, 1)))


def with_channels(image: Tensor, channels: int) -> Tensor:
    """``(3, h, w)`` linear light as it is for three channels, as ``(1, h, w)`` luminance for one; UserError else."""
    if channels == 3:
        return image
    if channels != 1:
        raise UserError(f"a target has 3 channels (R, G, B) or 1 (luminance), not {channels}")
    return torch.einsum("c,chw->hw", torch.tensor(LUMINANCE), image)[None].clamp(0.0, 1.0)


def known(kind: str, item: str, allowed: Sequence[str]) -> str:
    """The item itself when it is one of ``allowed``; else a UserError that suggests one. ``kind`` as 'photograph'."""
    if item not in allowed:
        raise UserError(f"unknown {kind} '{item}'; {suggest(item, allowed)}")
    return item


def chosen(kind: str, names: Sequence[str], allowed: Sequence[str]) -> list[str]:
    """The names as a list, each known and given once; UserError for an empty list, an unknown or repeated name."""
    if not names:
        raise UserError(f"the list of {kind}s is empty; allowed: {', '.join(allowed)}")
    for index, name in enumerate(names):
        if known(kind, name, allowed) in names[:index]:
            raise UserError(f"{kind} '{name}' is given twice in names")
    return list(names)


def named_digest(*names: object) -> str:
    """SHA-256 of names, for an image that is drawn from its names alone; one of them is a version of the drawing."""
    return hashlib.sha256("\x1f".join(str(name) for name in names).encode()).hexdigest()
