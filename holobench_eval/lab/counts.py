"""What a camera counted, from a file: a picture, its RAW file, or numbers in .npy."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.errors import CellError, PictureError, UserError
from ..core.pictures import LARGEST_PIXELS, open_picture
from ..methods.files.arrays import read_array
from .raw import read_raw

# of cameras with a Bayer mosaic
RAW_SUFFIXES = (".arw", ".cr2", ".cr3", ".dng", ".nef", ".orf", ".pef", ".raf", ".rw2", ".srw")
NUMBERS = ".npy"
LEAST, MOST = 1e-22, 1e15  # of floating point: beyond them single precision ends
FORMATS = ("PNG", "TIFF", "BMP", "WEBP", "JPEG")
RIGHT = "expected an 8-bit or 16-bit PNG or TIFF, gray or RGB, or a BMP, WebP or JPEG"


@dataclass(frozen=True, eq=False)
class Counts:
    """A photograph as its file has it.

    values: ``(C, H, W)`` uint8, uint16 or floating point, C = 1 or 3, red first; white: the value of full scale, or of
    floating point, which has none, the highest: what is clipped has that; black: values without light ``(C, 1, 1)``
    that a RAW file states, else 0; is_raw; is_lossy: compressed with loss; is_opaque: an alpha channel was left out
    that is opaque everywhere.
    """

    values: NDArray[Any]
    white: float
    black: NDArray[np.float32]
    is_raw: bool = False
    is_lossy: bool = False
    is_opaque: bool = False

    @property
    def is_linear(self) -> bool:
        """Whether no program writes display-encoded values so: RAW files and floating point."""
        return self.is_raw or self.values.dtype.kind == "f"


def read_counts(
    content: bytes, path: Path, linear: bool, upright: bool = True, largest: int = LARGEST_PIXELS
) -> Counts:
    """The contents of a photograph's file.

    path: for its ending and for errors; linear: pictures may say that they are proportional to light, and not only that
    they are sRGB; upright: pictures are turned as their EXIF orientation says, RAW files never; largest: pixels.
    UserError, one line, for a file that is damaged or of another kind.
    """
    ending = path.suffix.lower()
    if ending in RAW_SUFFIXES:
        raw = read_raw(content, str(path))
        return Counts(raw.counts.transpose(2, 0, 1), raw.white, raw.black, is_raw=True)
    try:
        if ending == NUMBERS:
            return _counts(_planes_last(read_array(path, content=content), largest))
        stored = open_picture(content, largest)
        if stored.format not in FORMATS:
            raise PictureError(f"a {stored.format} file under another name")
        stored.refuse_other_colours(linear)
        values = stored.upright() if upright else stored.values()
        return _counts(values, is_lossy=stored.is_lossy, is_opaque=stored.has_alpha)
    except CellError as error:
        raise UserError(str(error)) from error
    except PictureError as error:
        right = "expected (H, W) or (H, W, 3) of floating point, uint8 or uint16" if ending == NUMBERS else RIGHT
        raise UserError(f"{path}: {error}; {right}") from error


def _counts(values: NDArray[Any], **facts: bool) -> Counts:
    planes = values[None] if values.ndim == 2 else values.transpose(2, 0, 1)
    if values.dtype.kind == "u":
        white = float(np.iinfo(values.dtype).max)
    else:
        low, white = float(values.min()), float(values.max())
        if not np.isfinite(low + white):
            raise PictureError("values that are NaN or infinite")
        if white > 0 and not (white > LEAST and max(white, -low) < MOST):
            raise PictureError(f"values from {low:.3g} to {white:.3g}, which no camera counts")
    return Counts(planes, white, np.zeros((1, 1, 1), np.float32), **facts)


def _planes_last(values: NDArray[Any], largest: int) -> NDArray[Any]:
    """Numbers ``(H, W)`` or ``(H, W, 3)``, from an array that may have its colours first, or a single one."""
    values = values.astype(
        values.dtype.newbyteorder("="), copy=False
    )  # numbers of another byte order have no type else
    if values.ndim == 3 and values.shape[2] == 1:
        values = values[..., 0]
    if values.ndim == 3 and values.shape[2] != 3 and values.shape[0] in (1, 3):
        values = values.transpose(1, 2, 0) if len(values) == 3 else values[0]
    if values.ndim not in (2, 3) or values.shape[2:] not in ((), (3,)) or not values[..., :1].size > 0:
        raise PictureError(f"an array of {' x '.join(map(str, values.shape))}")
    if values.dtype.kind != "f" and values.dtype not in (np.uint8, np.uint16):
        raise PictureError(f"an array of {values.dtype}")
    if values.shape[0] * values.shape[1] > largest:
        raise PictureError(f"{values.shape[1]} x {values.shape[0]} pixels; expected at most {largest // 10**6} million")
    return values


def step(values: NDArray[Any]) -> int:
    """The largest power of two, up to 256, that divides every unsigned value; 0 where there is no light at all."""
    joined = int(np.bitwise_or.reduce(values, axis=None))
    return min(joined & -joined, 256)
