"""Read an image file as linear light, or refuse it with one line: what was found and what would be right.

A harness that converts whatever it meets scores images nobody looked at: a 16-bit file read as 8 bits, a palette read
as gray levels, an alpha channel dropped. So only 8-bit sRGB is taken as it is, and the rest by explicit choice.
"""

from __future__ import annotations

import io
import warnings
import zlib
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageCms, ImageOps, UnidentifiedImageError
from torch import Tensor

from ..core.errors import UserError
from ..core.io import decode_levels
from .base import from_srgb, planes

# what 16-bit levels mean: nothing certain, sRGB levels, or linear light
SixteenBit = Literal["refuse", "srgb", "linear"]

# formats that are opened at all; Pillow would hand others to outside programs
FORMATS = ("PNG", "JPEG", "TIFF", "BMP", "WEBP", "GIF")

# file names (lower case) that are taken for images
SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp", ".gif"})

# 7680 x 4320, more than any panel shows; as linear light an image takes twelve bytes a pixel, and as much for a while.
LARGEST_PIXELS = 33_177_600

LARGEST_BYTES = 512_000_000  # enough for the largest image in 16 bits without compression

RIGHT = "expected an 8-bit RGB image in sRGB"
ROUNDING = 1e-6  # by which linear light may leave [0, 1], as in the metric protocol

_MODES = {
    "1": "a 1-bit image",
    "P": "a palette image",
    "PA": "a palette image with alpha",
    "LA": "an image with alpha",
    "La": "an image with alpha",
    "RGBA": "an image with alpha",
    "RGBa": "an image with alpha",
    "CMYK": "a CMYK image",
    "YCbCr": "a YCbCr image",
    "LAB": "a CIELAB image",
    "F": "a floating-point image",
    "I": "a 32-bit gray image",
}
_BITS_PER_SAMPLE = 258  # TIFF 6.0, section 8
_ORIENTATION = 274  # Exif 2.32, section 4.6.4

_ONE_CHANNEL = "a one-channel image (gray: true would replicate it to three)"

PNG_END = b"\x00\x00\x00\x00IEND\xaeB`\x82"  # the last chunk of every PNG (PNG specification, section 11.2.4)


class GrayImageError(UserError):
    """An image that has one channel, where that was not allowed."""


def read(path: Path) -> bytes:
    """The contents of an image file; UserError when it is missing, no regular file, unreadable or too large."""
    if not path.is_file():
        raise UserError(f"{path}: {'not a regular file' if path.exists() else 'no such file'}; {RIGHT}")
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST_BYTES + 1)
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from error
    if len(content) > LARGEST_BYTES:
        raise UserError(f"{path}: larger than {LARGEST_BYTES // 10**6} MB; {RIGHT}")
    return content


def decode(content: bytes, name: str, gray: bool = False, sixteen_bit: SixteenBit = "refuse") -> Tensor:
    """An image file as ``(3, H, W)`` linear light in [0, 1], float32, upright as its EXIF orientation says.

    content: the file; name: used in errors. gray: take one-channel images too, replicated to three channels.
    sixteen_bit: take 16-bit PNG and TIFF too, as sRGB levels or as linear light; they must be stored upright.
    UserError, one line, for an image that is damaged, of another kind (`GrayImageError`: of one channel), larger than
    33 million pixels, or of another colour space by its ICC profile.
    """
    image = opened(content, name)
    if image.format == "PNG":
        refuse_short_png(image, content, name)
    fault = _fault(image, gray)
    bits = _bits(image, content)
    if fault is None and bits == 16 and sixteen_bit == "refuse":
        fault = "a 16-bit image (sixteen_bit: srgb or linear would say what its levels mean)"
    if fault is None and bits not in (8, 16):
        fault = f"a {bits}-bit image"
    if fault is not None:
        raise (GrayImageError if fault == _ONE_CHANNEL else UserError)(f"{name}: {fault}; {RIGHT}")
    refuse_other_colours(image, name)
    turned, stored_upright = _load(image, name)
    if bits == 8:
        return from_srgb(np.asarray(turned))
    if not stored_upright:
        # OpenCV turns a 16-bit TIFF and leaves a PNG as it is, which another release may do otherwise.
        raise UserError(f"{name}: a 16-bit image with an EXIF orientation; expected one that is stored upright")
    deep = _deep(content, name)
    return planes((deep / np.float32(65535)).astype(np.float32)) if sixteen_bit == "linear" else from_srgb(deep)


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


def opened(content: bytes, name: str) -> Image.Image:
    """The header of an image file, with the number of pixels and of frames checked. UserError as in ``decode``."""
    try:
        with warnings.catch_warnings():
            # Pillow's own limit, which an importing program may have lifted, is only the first line.
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            image = Image.open(io.BytesIO(content), formats=FORMATS)
        too_large = image.width * image.height > LARGEST_PIXELS
        frames = 1 if too_large else getattr(image, "n_frames", 1)
    except UnidentifiedImageError as error:
        raise UserError(f"{name}: not an image in {', '.join(FORMATS)}, or its header is damaged; {RIGHT}") from error
    except Image.DecompressionBombError as error:
        raise UserError(f"{name}: claims more than {LARGEST_PIXELS // 10**6} million pixels; {RIGHT}") from error
    except Exception as error:  # whatever a decoder trips over in a damaged file
        raise UserError(f"{name}: damaged: {_line(error)}; {RIGHT}") from error
    if too_large:
        size = f"{image.width} x {image.height} pixels"
        raise UserError(f"{name}: {size}; expected at most {LARGEST_PIXELS // 10**6} million")
    if frames != 1:
        raise UserError(f"{name}: {frames} frames or pages; expected a file with one image")
    return image


def refuse_short_png(image: Image.Image, content: bytes, name: str) -> None:
    """UserError for a PNG without its end or with too few rows; Pillow takes the first and fills up the second."""
    if PNG_END not in content:
        raise UserError(f"{name}: truncated or damaged: the end of the PNG is missing; {RIGHT}")
    samples = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}.get(content[25], 0)  # by colour type: specification, section 11.2.1
    row = 1 + (image.width * content[24] * samples + 7) // 8
    interlaced = content[28] != 0  # rows of other lengths, which no camera and no renderer writes
    if not interlaced and _inflated(content, image.height * row) < image.height * row:
        raise UserError(f"{name}: truncated or damaged: rows of the PNG are missing; {RIGHT}")


def _inflated(content: bytes, most: int) -> int:
    """Bytes of a PNG's pixels once decompressed; those up to a fault, and not many more than ``most``."""
    stream, size, at = zlib.decompressobj(), 0, 8
    while at + 8 <= len(content) and size < most:
        length, kind = int.from_bytes(content[at : at + 4], "big"), content[at + 4 : at + 8]
        rest = content[at + 8 : at + 8 + length] if kind == b"IDAT" else b""
        try:
            while rest and size < most:
                size += len(stream.decompress(rest, 1 << 20))
                rest = stream.unconsumed_tail
        except zlib.error:
            break
        at += 12 + length
    return size


def _fault(image: Image.Image, gray: bool) -> str | None:
    """What is wrong with the kind of an image, in words, or None."""
    if image.mode not in _MODES and "transparency" in image.info:
        return "an image with a transparent colour"
    if image.mode == "L" or image.mode.startswith("I;16"):
        return None if gray else _ONE_CHANNEL
    return None if image.mode == "RGB" else _MODES.get(image.mode, f"an image of mode {image.mode}")


def _bits(image: Image.Image, content: bytes) -> int:
    """Bits a sample in the file; Pillow itself shows 16-bit RGB as 8-bit."""
    if image.format == "PNG":
        return content[24]  # PNG specification, section 11.2.1 (IHDR)
    if image.format == "TIFF":
        # A Pillow image of format TIFF has its tags; the base class does not know them.
        tags = image.tag_v2  # type: ignore[attr-defined]
        return int(max(tags.get(_BITS_PER_SAMPLE, (1,))))
    return 8


def refuse_other_colours(image: Image.Image, name: str) -> None:
    """UserError for an embedded ICC profile that is not sRGB by its description."""
    profile = image.info.get("icc_profile")
    if not profile:
        return
    try:
        opened = ImageCms.ImageCmsProfile(io.BytesIO(profile))
        description = " ".join(ImageCms.getProfileDescription(opened).split())
    except (OSError, ImageCms.PyCMSError) as error:
        raise UserError(f"{name}: its ICC colour profile cannot be read; {RIGHT}, or without a profile") from error
    if "srgb" not in description.lower():
        raise UserError(f"{name}: its ICC colour profile is '{description[:60]}'; convert it to sRGB: {RIGHT}")


def _load(image: Image.Image, name: str) -> tuple[Image.Image, bool]:
    """The decoded image, upright, and whether it was stored so; UserError for a truncated or damaged file."""
    try:
        upright = image.getexif().get(_ORIENTATION, 1) == 1
        image.load()
        return ImageOps.exif_transpose(image), upright
    except Exception as error:  # whatever a decoder trips over in a damaged file
        raise UserError(f"{name}: truncated or damaged: {_line(error)}; {RIGHT}") from error


def _deep(content: bytes, name: str) -> NDArray[np.uint16]:
    """``(H, W)`` or ``(H, W, 3)`` 16-bit levels, by OpenCV, which keeps them in RGB where Pillow does not."""
    levels = decode_levels(content)
    if levels is None or levels.dtype != np.uint16:
        raise UserError(f"{name}: a 16-bit image that OpenCV cannot read; {RIGHT}, or a 16-bit PNG")
    return levels.astype(np.uint16)


def _line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
