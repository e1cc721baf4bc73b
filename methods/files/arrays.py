"""Read an array of phases or of a complex field from a picture, .npy, .npz or .mat; no code is run by it."""

from __future__ import annotations

import io
import json
import subprocess
import sys
import zipfile
from collections.abc import Mapping
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.errors import CellError, PictureError
from ...core.pictures import open_picture

PICTURES = (".png", ".tif", ".tiff", ".bmp")
FORMATS = ("PNG", "TIFF", "BMP")
SUFFIXES = (*PICTURES, ".npy", ".npz", ".mat")
SECONDS = 120.0  # that reading a .mat file may take
MOST_PIXELS = 200_000_000  # of a picture
LARGEST_BYTES = 1_000_000_000  # a complex field of three colours on a panel of 4K in double precision takes 400 MB


def read_array(path: Path, variable: str = "", content: bytes | None = None) -> NDArray[Any]:
    """The array of a file, as it is stored; a picture's levels as ``(H, W)`` or ``(H, W, C)`` with red first.

    variable: the name of the array in a .npz or .mat file; empty where there is only one; content: of the file, where
    it was read before. CellError, one line, for a file that is missing, damaged, of another kind or too large, and for
    an array that does not hold plain numbers.
    """
    if not path.is_file():
        raise CellError(f"{path}: {'not a regular file' if path.exists() else 'no such file'}")
    if path.stat().st_size > LARGEST_BYTES:
        raise CellError(f"{path}: larger than {LARGEST_BYTES // 10**6} MB")
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise CellError(f"{path}: phases are read from {', '.join(SUFFIXES)}")
    try:
        if suffix == ".mat":
            array = _matlab(path, variable)
        else:
            content = path.read_bytes() if content is None else content
            array = _picture(content) if suffix in PICTURES else _numbers(content, suffix, variable)
    except CellError as error:
        raise CellError(f"{path}: {error}") from None
    except Exception as error:  # whatever a reader trips over in a damaged file
        first = next(iter(str(error).splitlines()), type(error).__name__)
        raise CellError(f"{path}: damaged, or no {suffix} file: {first[:200]}") from None
    if array.dtype.kind not in "uifc" or not array.size:
        raise CellError(f"{path}: holds {array.size} values of type {array.dtype}; expected numbers")
    return array.astype(array.dtype.newbyteorder("="), copy=False)  # the machine's own, as torch demands


def _picture(content: bytes) -> NDArray[Any]:
    """The levels of a picture that are stored as they are: not turned, and not stretched to 8 bits."""
    try:
        stored = open_picture(content, MOST_PIXELS)
        turned, kind = stored.orientation, f"{stored.bits}-bit {'floating-point ' if stored.is_floating else ''}picture"
        for is_other, fault in (
            (stored.format not in FORMATS, f"no picture of 8 or 16 bits that can be read as {', '.join(FORMATS)}"),
            (stored.has_alpha, "a picture with alpha; expected gray or RGB"),
            (turned != 1, f"a picture with EXIF orientation {turned}; expected one that is stored upright"),
            (stored.is_floating or stored.bits not in (8, 16), f"a {kind}; expected 8 or 16 bits"),
            # the values of a palette are places in a table, whose colours may be the levels or anything else
            (stored.has_palette, "a picture with a palette; expected gray or RGB, whose values are the levels"),
            (stored.is_lossy, "a picture that is compressed with loss; expected its levels as they are"),
        ):
            if is_other:
                raise CellError(fault)
        return stored.values()
    except PictureError as error:
        raise CellError(f"no picture of 8 or 16 bits that can be read: {error}") from None


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
