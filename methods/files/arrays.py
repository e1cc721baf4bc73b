"""Read an array of phases or of a complex field from a picture, .npy, .npz or .mat; no code is run by it."""

from __future__ import annotations

import io
import json
import subprocess
import sys
import warnings
import zipfile
from collections.abc import Mapping
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from ...core.errors import CellError
from ...core.io import decode_levels

PICTURES = (".png", ".tif", ".tiff", ".bmp")
FORMATS = ("PNG", "TIFF", "BMP")
SUFFIXES = (*PICTURES, ".npy", ".npz", ".mat")
SECONDS = 120.0  # that reading a .mat file may take
BITS_PER_SAMPLE = 258  # TIFF 6.0, section 8
ORIENTATION = 274  # Exif 2.32, section 4.6.4
LARGEST_BYTES = 1_000_000_000  # a complex field of three colours on a panel of 4K in double precision takes 400 MB


def read_array(path: Path, variable: str = "") -> NDArray[Any]:
    """The array of a file, as it is stored; a picture's levels as ``(H, W)`` or ``(H, W, C)`` with red first.

    variable: the name of the array in a .npz or .mat file; empty where there is only one. CellError, one line, for a
    file that is missing, damaged, of another kind or too large, and for an array that does not hold plain numbers.
    """
    if not path.is_file():
        raise CellError(f"{path}: {'not a regular file' if path.exists() else 'no such file'}")
    if path.stat().st_size > LARGEST_BYTES:
        raise CellError(f"{path}: larger than {LARGEST_BYTES // 10**6} MB")
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise CellError(f"{path}: phases are read from {', '.join(SUFFIXES)}")
    try:
        array = _matlab(path, variable) if suffix == ".mat" else _content(path.read_bytes(), suffix, variable)
    except CellError as error:
        raise CellError(f"{path}: {error}") from None
    except Exception as error:  # whatever a reader trips over in a damaged file
        first = next(iter(str(error).splitlines()), type(error).__name__)
        raise CellError(f"{path}: damaged, or no {suffix} file: {first[:200]}") from None
    if array.dtype.kind not in "uifc" or not array.size:
        raise CellError(f"{path}: holds {array.size} values of type {array.dtype}; expected numbers")
    return array.astype(array.dtype.newbyteorder("="), copy=False)  # the machine's own, as torch demands


def _content(content: bytes, suffix: str, variable: str) -> NDArray[Any]:
    return _picture(content) if suffix in PICTURES else _numbers(content, suffix, variable)


def _picture(content: bytes) -> NDArray[Any]:
    levels = decode_levels(content)
    if levels is None:
        raise CellError("no picture of 8 or 16 bits that can be read, or a damaged one")
    if levels.ndim == 3 and levels.shape[2] == 4:
        raise CellError("a picture with alpha; expected gray or RGB")
    _refuse_altered(content)
    return levels


def _refuse_altered(content: bytes) -> None:
    """CellError for a picture that OpenCV gives otherwise than it is stored: one page of several, turned by its EXIF
    orientation (a TIFF, and no PNG), or with fewer than 8 bits stretched to 8."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # large panels are no attack
        try:
            image = Image.open(io.BytesIO(content), formats=FORMATS)
        except UnidentifiedImageError:
            raise CellError(f"no picture of 8 or 16 bits that can be read as {', '.join(FORMATS)}") from None
    frames, orientation = getattr(image, "n_frames", 1), image.getexif().get(ORIENTATION, 1)
    if frames != 1:
        raise CellError(f"{frames} frames or pages; expected a file with one picture")
    if orientation != 1:
        raise CellError(f"a picture with EXIF orientation {orientation}; expected one that is stored upright")
    if (bits := _bits(image, content)) < 8:
        raise CellError(f"a {bits}-bit picture; expected 8 or 16 bits")


def _bits(image: Image.Image, content: bytes) -> int:
    """Bits a sample, or an index of a palette, in the file."""
    if image.format == "PNG":
        return content[24]  # PNG specification, section 11.2.1 (IHDR)
    if image.format == "TIFF":
        return int(min(image.tag_v2.get(BITS_PER_SAMPLE, (1,))))  # type: ignore[attr-defined]
    return min(content[28], 8)  # BITMAPINFOHEADER, biBitCount: of a whole pixel


def _numbers(content: bytes, suffix: str, variable: str) -> NDArray[Any]:
    if suffix == ".npy":
        _refuse_large(_npy_shape(io.BytesIO(content)))
        return np.asarray(np.load(io.BytesIO(content), allow_pickle=False))
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        sizes = {info.filename.removesuffix(".npy"): (info.file_size,) for info in archive.infolist()}
    name = _chosen(sizes, variable)
    with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
        return np.asarray(arrays[name])


def _matlab(path: Path, variable: str) -> NDArray[Any]:
    command = [sys.executable, str(Path(__file__).with_name("matlab.py")), str(path), variable, str(LARGEST_BYTES)]
    try:
        done = subprocess.run(command, capture_output=True, timeout=SECONDS, check=False)
    except subprocess.TimeoutExpired:
        raise CellError(f"not read within {SECONDS:g} s") from None
    if done.returncode:
        said = done.stderr.decode(errors="replace").splitlines()
        crashed = f"damaged: its reader ends with {done.returncode}"
        raise CellError(said[-1][:200] if said and done.returncode == 1 else crashed)
    sizes, _, array = done.stdout.partition(b"\n")
    _chosen(json.loads(sizes), variable)
    return np.asarray(np.load(io.BytesIO(array), allow_pickle=False))


def _npy_shape(file: io.BytesIO) -> tuple[int, ...]:
    version = np.lib.format.read_magic(file)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, kind = read(file)
    return (*shape, kind.itemsize)


def _chosen(sizes: Mapping[str, tuple[int, ...]], variable: str) -> str:
    """The name of the array to read. sizes: by name, numbers whose product is the bytes that it takes at most."""
    if not variable and len(sizes) == 1:
        variable = next(iter(sizes))
    if variable not in sizes:
        found = ", ".join(sorted(sizes)[:10]) or "nothing"
        wanted = f"no variable '{variable}'" if variable else "several variables; name one as 'variable'"
        raise CellError(f"{wanted}; it holds {found}")
    _refuse_large(sizes[variable])
    return variable


def _refuse_large(size: tuple[int, ...]) -> None:
    if prod(size) > LARGEST_BYTES:
        raise CellError(f"holds an array of more than {LARGEST_BYTES // 10**6} MB")
