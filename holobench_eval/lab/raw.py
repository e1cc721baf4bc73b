"""Camera RAW and DNG files as linear counts: nothing is interpolated, balanced, denoised or curved (extra ``raw``)."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.errors import UserError
from ..core.installed import installing

LARGEST = 512 * 2**20  # bytes; the RAW files of medium-format cameras have 200 MB


@dataclass(frozen=True, eq=False)
class RawFrame:
    """What a sensor with a Bayer mosaic counted.

    counts: ``(Hs, Ws, 3)`` uint16 red, green, blue at half the sensor's rows and columns, black level not subtracted,
    as the sensor lies (a camera's notion of upright is not followed); white: counts from which a sample is saturated;
    black: counts of red, green and blue without light ``(3, 1, 1)``, as the file has them, below white.
    """

    counts: NDArray[np.uint16]
    white: float
    black: NDArray[np.float32]


def read_raw(content: bytes, name: str = "the RAW file") -> RawFrame:
    """The counts in the bytes of a RAW or DNG file; name: stands for them in errors.

    Every group of 2x2 photosites becomes one pixel: its red, its blue, and the mean of its two greens, rounded to the
    even count, or white where either of them is saturated. So colours lie up to half a pixel apart, which a
    registration of each colour takes up, and no light is taken from a neighbour. UserError in one line: rawpy is not
    installed, no RAW file, a sensor without a Bayer mosaic (X-Trans, Foveon, sRAW, linear DNG).
    """
    try:
        import rawpy
    except ImportError as error:
        raise UserError(f"RAW files need the package rawpy: {installing(extra='raw')}") from error

    if len(content) > LARGEST:
        raise UserError(f"{name}: larger than {LARGEST >> 20} MiB, no photograph")
    if is_jpeg(content):
        raise UserError(f"{name}: a JPEG, whose values are not linear in light; set the camera to RAW")
    try:
        with rawpy.imread(io.BytesIO(content)) as raw:
            return _frame(raw, name)
    except UserError:
        raise
    except Exception as error:  # a damaged file fails in many ways
        reason = error.args[0].decode() if error.args and isinstance(error.args[0], bytes) else str(error)
        raise UserError(f"{name}: not a RAW file that LibRaw can read ({reason or type(error).__name__})") from error


def is_jpeg(data: bytes) -> bool:
    """Whether a file begins as a JPEG does, whatever its name says."""
    return data[:3] == b"\xff\xd8\xff"


def _frame(raw: Any, where: str) -> RawFrame:
    pattern = raw.raw_pattern
    letters = raw.color_desc.decode()
    mosaic = raw.raw_image_visible
    colours = [] if pattern is None or pattern.shape != (2, 2) else [letters[site] for site in pattern.flat]
    if sorted(colours) != ["B", "G", "G", "R"] or mosaic.ndim != 2:
        raise UserError(f"{where}: no 2x2 Bayer mosaic of red, green and blue; the camera's full RAW is needed")
    # the pattern is that of the whole image, but the sites of the visible one are what is read
    sites = raw.raw_colors_visible[:2, :2]
    rows, columns = (side // 2 * 2 for side in mosaic.shape)
    if not rows or not columns:
        raise UserError(f"{where}: an image of {mosaic.shape[0]} by {mosaic.shape[1]} photosites")

    whites = [float(level) for level in raw.camera_white_level_per_channel or () if level > 0]
    white = min(whites, default=float(raw.white_level))
    planes: dict[str, list[NDArray[np.uint16]]] = {"R": [], "G": [], "B": []}
    for (row, column), site in np.ndenumerate(sites):
        planes[letters[site]].append(mosaic[row:rows:2, column:columns:2])
    first, second = (plane.astype(np.float64) for plane in planes["G"])
    green = np.where(np.maximum(first, second) >= white, np.maximum(first, second), np.rint((first + second) / 2))
    counts = np.stack([planes["R"][0], green.astype(np.uint16), planes["B"][0]], axis=-1)
    levels = list(zip(raw.black_level_per_channel, letters, strict=False))  # green has two
    means = [np.mean([level for level, letter in levels if letter == wanted]) for wanted in "RGB"]
    black = np.array(means, dtype=np.float32)[:, None, None]
    if black.max() >= white:
        raise UserError(f"{where}: black at {black.max():g} counts and white at {white:g}; expected black below")
    return RawFrame(counts, white, black)
