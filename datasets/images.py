"""Read an image file as linear light, or refuse it with one line: what was found and what would be right.

A harness that converts whatever it meets scores images nobody looked at: a 16-bit file read as 8 bits, a palette read
as gray levels, alpha that matters dropped. So only 8-bit sRGB is taken as it is, and the rest by explicit choice.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from ..core.errors import PictureError, UserError
from ..core.io import read_regular
from ..core.pictures import Stored, open_picture
from .base import from_srgb, planes

# what 16-bit levels mean: nothing certain, sRGB levels, or linear light
SixteenBit = Literal["refuse", "srgb", "linear"]

# file names (lower case) that are taken for images
SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp", ".gif"})

LARGEST_BYTES = 512_000_000  # enough for the largest image in 16 bits without compression

RIGHT = "expected an 8-bit RGB image in sRGB"
ROUNDING = 1e-6  # by which linear light may leave [0, 1], as in the metric protocol

_ONE_CHANNEL = "a one-channel image (gray: true would replicate it to three)"


class GrayImageError(PictureError):
    """An image that has one channel, where that was not allowed."""


def read(path: Path) -> bytes:
    """The contents of an image file; UserError when it is missing, no regular file, unreadable or too large."""
    if not path.is_file():
        absent = "a link that leads to no file" if path.is_symlink() else "no such file"
        raise UserError(f"{path}: {'not a regular file' if path.exists() else absent}; {RIGHT}")
    try:
        return read_regular(path, LARGEST_BYTES)
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from error


def decode(content: bytes, name: str, gray: bool = False, sixteen_bit: SixteenBit = "refuse") -> Tensor:
    """An image file as ``(3, H, W)`` linear light in [0, 1], float32, upright as its EXIF orientation says.

    content: the file; name: used in errors. gray: take one-channel images too, replicated to three channels.
    sixteen_bit: take 16-bit PNG and TIFF too, as sRGB levels or as linear light. UserError, one line, for an image that
    is damaged, of another kind (`GrayImageError`: of one channel), larger than 33 million pixels, of another colour
    space than sRGB, or has alpha that is not opaque everywhere.
    """
    try:
        stored = open_picture(content)
        if fault := _fault(stored, gray, sixteen_bit):
            raise (GrayImageError if fault == _ONE_CHANNEL else PictureError)(fault)
        is_linear = stored.bits == 16 and sixteen_bit == "linear"
        stored.refuse_other_colours(is_linear)
        levels = stored.upright()
    except PictureError as error:
        raise type(error)(f"{name}: {error}; {RIGHT}") from error
    return planes((levels / np.float32(65535)).astype(np.float32)) if is_linear else from_srgb(levels)


def from_array(picture: NDArray[Any]) -> Tensor:
    """An array as ``(3, H, W)`` linear light in [0, 1], float32; gray is replicated.

    picture: ``(H, W)``, ``(H, W, 3)``, ``(3, H, W)`` or ``(1, H, W)``, the first of them that fits; uint8 holds sRGB
    levels, floating point holds linear light in [0, 1]. UserError, one line, for any other.
    """
    shape = picture.shape
    colour_last = picture.ndim == 2 or (picture.ndim == 3 and shape[2] == 3)
    if not (colour_last or (picture.ndim == 3 and shape[0] in (1, 3))) or not picture.size:
        raise UserError(f"a picture of {shape}; expected (H, W), (H, W, 3), (3, H, W) or (1, H, W)")
    if not colour_last:
        picture = picture[0] if shape[0] == 1 else picture.transpose(1, 2, 0)
    if picture.dtype == np.uint8:
        return from_srgb(picture)
    right = "a picture holds uint8 sRGB levels, or floating-point linear light in [0, 1]"
    if picture.dtype.kind != "f":
        raise UserError(f"{right}; this one is of {picture.dtype}")
    low, high = float(picture.min()), float(picture.max())
    if not (low >= -ROUNDING and high <= 1 + ROUNDING):  # nor NaN
        raise UserError(f"{right}; this one is of {picture.dtype} with values from {low:.4g} to {high:.4g}")
    return planes(picture.astype(np.float32).clip(0, 1))


def _fault(stored: Stored, gray: bool, sixteen_bit: SixteenBit) -> str | None:
    """What is wrong with the kind of an image, in words, or None."""
    if stored.has_palette:
        return "a palette image"
    if stored.is_floating or stored.bits not in (8, 16):
        return f"a {stored.bits}-bit {'floating-point ' if stored.is_floating else ''}image"
    if stored.channels == 1 and not gray:
        return _ONE_CHANNEL
    if stored.bits == 16 and sixteen_bit == "refuse":
        return (
            "a 16-bit image (in a study, sixteen_bit: srgb or linear of the dataset folder says what its levels mean)"
        )
    return None
