"""A picture file of ``holoeval score``: checked when it is first read, and decoded without a guess."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...core.errors import UserError, reason
from ...core.io import decode_levels
from ...datasets.images import RIGHT as RIGHT_FOR_DATASETS
from ...datasets.images import opened, read, refuse_other_colours, refuse_short_png
from ...imaging.similarity import reduced
from ...lab.raw import read_raw
from .exposure import Levels, levels

SUFFIXES = (".png", ".tif", ".tiff", ".bmp", ".webp", ".jpg", ".jpeg")
# Of cameras with a Bayer mosaic.
RAW_SUFFIXES = (".arw", ".cr2", ".cr3", ".dng", ".nef", ".orf", ".pef", ".rw2", ".srw")
FORMATS = ("PNG", "TIFF", "BMP", "WEBP", "JPEG")
MODES = ("1", "L", "P", "RGB", "LA", "RGBA")  # that are decoded without loss, if an alpha channel is opaque
RIGHT = "expected an 8-bit or 16-bit PNG or TIFF, gray or RGB, or a BMP, WebP or JPEG"
SMALLEST = 32  # pixels a side
WIDEST = 16_384  # pixels a side
NEARLY_GRAY = 3 / 255  # by which the channels of a gray picture differ that was stored in colour, as in a JPEG
EXCEPT = 1e-3  # of the pixels, which may differ by more
ROUNDING = 1e-6
FACTS_SIDE = 96  # pixels of the longer side to which noise is averaged away

Values = NDArray[np.float32]


@dataclass(frozen=True)
class Picture:
    """A picture file that was read once and is valid.

    shape: ``(C, h, w)``, C = 1 or 3; sha256: of the file; pixels_sha256: of its values. gray: whether all channels are
    equal; nearly_gray: whether they are so within `NEARLY_GRAY`, but not equal; opaque: whether an alpha channel was
    left out that is opaque everywhere; is_lossy: whether it was compressed with loss. structure: standard deviation of
    each channel's values, noise averaged away; levels: of each channel, whatever their brightness.
    """

    path: Path
    shape: tuple[int, int, int]
    sha256: str
    pixels_sha256: str
    gray: bool
    nearly_gray: bool
    opaque: bool
    is_lossy: bool
    structure: tuple[float, ...]
    levels: tuple[Levels, ...]

    @property
    def is_raw(self) -> bool:
        """Whether it is a camera's RAW file, whose values are linear in light."""
        return self.path.suffix.lower() in RAW_SUFFIXES

    def load(self) -> Values:
        """Its values ``(C, h, w)`` as stored, over the full scale of 8 or 16 bits. UserError if it was changed.

        Of a RAW file: counts above black, over those of white.
        """
        content = read(self.path)
        if hashlib.sha256(content).hexdigest() != self.sha256:
            raise UserError(f"{self.path}: changed while it was being scored; start again")
        return _decoded(content, self.path)[0]


def checked(path: Path) -> Picture:
    """A picture file, read and looked at. UserError for one that is damaged, of another kind, or of another size."""
    try:
        content = read(path)
        values, alpha = _decoded(content, path)
    except UserError as error:
        raise UserError(str(error).replace(RIGHT_FOR_DATASETS, RIGHT)) from error
    channels, height, width = values.shape
    if min(height, width) < SMALLEST or max(height, width) > WIDEST:
        raise UserError(f"{path}: {width} x {height} pixels; expected sides from {SMALLEST} to {WIDEST} pixels")
    gray = all(np.array_equal(plane, values[0]) for plane in values[1:])
    return Picture(
        path,
        (channels, height, width),
        hashlib.sha256(content).hexdigest(),
        hashlib.sha256(repr(values.shape).encode() + values.tobytes()).hexdigest(),
        gray=gray,
        nearly_gray=not gray and float((np.ptp(values, axis=0) > NEARLY_GRAY + ROUNDING).mean()) <= EXCEPT,
        opaque=alpha,
        is_lossy=path.suffix.lower() in (".jpg", ".jpeg") or (content[8:12] == b"WEBP" and b"VP8L" not in content[:64]),
        structure=tuple(float(np.std(reduced(plane, FACTS_SIDE)[0])) for plane in values),
        levels=tuple(levels(plane) for plane in values),
    )


def _decoded(content: bytes, path: Path) -> tuple[Values, bool]:
    """``(C, h, w)`` values over full scale, and whether an opaque alpha channel was left out.

    UserError for a file that is damaged or of another kind.
    """
    if path.suffix.lower() in RAW_SUFFIXES:
        raw = read_raw(content, str(path))
        black = np.array(raw.black, dtype=np.float32)
        if black.max() >= raw.white:
            raise UserError(f"{path}: black at {black.max():g} counts and white at {raw.white:g}; expected black below")
        values = (raw.counts - black) / (np.float32(raw.white) - black)
        return np.ascontiguousarray(values.transpose(2, 0, 1), dtype=np.float32), False
    image = opened(content, str(path))
    if image.format not in FORMATS:
        raise UserError(f"{path}: a {image.format} file under another name; {RIGHT}")
    if "transparency" in image.info:
        raise UserError(f"{path}: an image with a transparent colour; {RIGHT}")
    if image.mode not in MODES and not image.mode.startswith("I;16"):
        raise UserError(f"{path}: an image of mode {image.mode}; {RIGHT}")
    refuse_other_colours(image, str(path))
    if image.format == "PNG":
        refuse_short_png(image, content, str(path))
    try:
        image.load()  # which reports truncated files that OpenCV would pad
    except Exception as error:  # whatever a decoder trips over in a damaged file
        raise UserError(f"{path}: truncated or damaged: {reason(error)}; {RIGHT}") from error
    pixels = decode_levels(content)
    if pixels is None:
        raise UserError(f"{path}: an image that cannot be decoded; {RIGHT}")
    full = 255 if pixels.dtype == np.uint8 else 65535
    alpha = pixels.ndim == 3 and pixels.shape[2] == 4
    if alpha and pixels[..., 3].min() < full:
        raise UserError(f"{path}: an image with alpha that is not opaque everywhere; {RIGHT}")
    planes = pixels[None] if pixels.ndim == 2 else pixels[..., :3].transpose(2, 0, 1)
    return np.ascontiguousarray(planes, dtype=np.float32) / np.float32(full), alpha
