"""Measured maps of a display: a file of arrays beside its profile, which act in the place of what the profile draws."""

from __future__ import annotations

import hashlib
import io
import math
import warnings
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path, PurePath
from typing import Annotated

import numpy as np
import torch
from annotated_types import Interval
from numpy.lib.format import read_array_header_1_0, read_magic
from torch import Tensor
from torch.nn import functional

from ...core.errors import UserError, suggest
from ...core.hashing import State, file_state
from ...core.io import read_regular
from ...optics.zernike import NAMES

LARGEST = 20_000_000  # bytes of a file, and of its arrays
HEADERS = 1_000  # bytes of the header of each array, at most


@dataclass(frozen=True)
class MapFile:
    """The file of a profile's maps, and what it held when the profile was written.

    file: an ``npz`` in the folder of the profile, or below it, null for no maps; size: of the file, at most 20 MB
    [bytes]; sha256: of the file, 64 hexadecimal digits.
    """

    file: str | None = None
    size: Annotated[int, Interval(ge=0, le=LARGEST)] = 0
    sha256: str | None = None


@dataclass(frozen=True)
class Map:
    """What an array is. axes: of it; low, high: of its values; instead: keys of the
    stage that it takes the place of, and which the profile may not give beside it."""

    axes: tuple[str, ...]
    unit: str
    low: float
    high: float
    meaning: str
    instead: tuple[str, ...] = ()


COLOURS, PAIR, OVER = ("colours",), ("colours", "2"), ("colours", "rows", "columns")
AXES = ("2", "rows", "columns")
KEYS: Mapping[str, Map] = {
    "lut.table": Map(
        ("colours", "levels"), "rad", -100, 100, "phase of each level", ("gamma", "bend", "table")
    ),
    "lut.gain": Map(OVER, "1", 0, 10, "factor of the phase over the panel, beside `gain`", ("variation",)),
    "crosstalk.width": Map(
        PAIR, "px", 0, 2, "standard deviation along a column and along a row of pixels", ("width", "ratio")
    ),
    "illumination.amplitude": Map(
        OVER, "1", 0, 100, "of the light over the panel, whose mean square is the light's share of the nominal",
        ("beam_sigma", "offset", "fringes"),
    ),
    "illumination.phase": Map(OVER, "rad", -1000, 1000, "of the light over the panel, without `tilt`", ("phase_rms",)),
    "illumination.power": Map(COLOURS, "1", 0, 100, "factor of `power`"),
    "propagation.aberration": Map(
        ("colours", "modes"), "rad rms", -100, 100,
        f"at that colour, beside `aberration`: {', '.join(NAMES)}; none beyond the edge of the iris, or of the band",
    ),
    "zero_order.field": Map(
        PAIR, "1", -10, 10,
        "unmodulated light, real and imaginary part, where the modulated light has the amplitude 1",
        ("fraction", "phase"),
    ),
    "stray_light.blur": Map(
        PAIR, "px", 0, 20, "standard deviation of a Gaussian along columns and rows, of light that is not scattered"
    ),
    "stray_light.share": Map(COLOURS, "share of the light", 0, 1, "that is spread", ("share",)),
    "stray_light.reach": Map(COLOURS, "panel heights", 1e-4, 10, "of what is spread", ("reach",)),
    "relay.moved": Map(
        AXES, "px", -20, 20, "displacement of the picture, of rows and of columns, before what `relay` does to it"
    ),
    "sensor.shading": Map(OVER, "1", 0, 1000, "factor of the light over the image"),
    "sensor.exponent": Map(
        COLOURS, "1", 0.1, 10, "of the response: light of L white pixels is counted as L^exponent of them"
    ),
    "sensor.ambient": Map(COLOURS, "of a white pixel", -1, 10, "light that is always there, beside `ambient`"),
}  # fmt: skip
"""Every array that a file may hold, by stage and name, in the order of the stages."""


def load_maps(given: MapFile, folder: Path, sizes: Mapping[str, int]) -> dict[str, Tensor]:
    """The maps of a profile, by ``KEYS``.

    Parameters
    ----------
    given
        The file's name, size and SHA-256, as the profile has them.
    folder
        Of the profile.
    sizes
        Of the axes ``colours``, ``levels``, ``rows`` and ``columns``; a map over the panel may be coarser.

    Raises
    ------
    UserError
        A file that is elsewhere, another than was named, damaged or too large; an array that is unknown, of another
        type or shape, or with values beyond its range.
    """
    if given.file is None:
        return {}
    path = inside(given.file, folder)
    state = file_state(path)
    if state is None:
        raise UserError(f"no such file: {path}")
    loaded = _loaded(path, state, given.size, given.sha256)
    for key, values in loaded.items():
        axes = KEYS[key].axes
        wanted = tuple(sizes.get(axis) or (len(NAMES) if axis == "modes" else int(axis)) for axis in axes)
        coarser = (
            axes in (OVER, AXES)
            and values.ndim == 3
            and all(2 <= n <= most for n, most in zip(values.shape[1:], wanted[1:], strict=True))
        )
        if tuple(values.shape) != wanted and not (coarser and len(values) == wanted[0]):
            names = f"({', '.join(axes)}), here {wanted}{', or with fewer rows and columns' * (axes in (OVER, AXES))}"
            raise UserError(f"{path.name}: '{key}' has the shape {tuple(values.shape)}; expected {names}")
    return loaded


def inside(name: str, folder: Path) -> Path:
    """Where a file of a profile's folder is. UserError: not within the folder, or only by a link."""
    if PurePath(name).is_absolute() or ".." in PurePath(name).parts:
        raise UserError(f"{name!r} is not a file in the profile's folder; give its name, or a path below that folder")
    path = folder / name
    try:
        is_inside = path.resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError):  # links in a circle
        is_inside = False
    if not is_inside:
        raise UserError(f"{name!r} is a link that leaves the profile's folder; copy the file there")
    return path


def described(path: Path, most: int, size: int, sha256: str | None) -> bytes:
    """The bytes of a file, ``most`` at most. UserError: it cannot be read, or is not as the profile says."""
    try:
        content = read_regular(path, most)
    except OSError as error:
        raise UserError(f"{path} cannot be read: {error.strerror}") from error
    if len(content) != size:
        raise UserError(f"{path} has {len(content)} bytes, and the profile says {size}: another file, or damaged")
    if hashlib.sha256(content).hexdigest() != (sha256 or "").lower():
        raise UserError(f"{path} has another SHA-256 than the profile says: another file, or damaged")
    return content


@lru_cache(maxsize=4)
def _loaded(path: Path, _state: State, size: int, sha256: str | None) -> dict[str, Tensor]:
    """The arrays of a file that is as the profile says; read once while it stays as it is."""
    content = described(path, LARGEST, size, sha256)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            return _arrays(archive, path.name)
    except UserError:
        raise
    except Exception as error:  # whatever a reader trips over in a damaged file
        reason = " ".join(str(error).split())[:100]
        raise UserError(f"{path.name} is no npz file of plain arrays, as numpy.savez writes it ({reason})") from error


def _arrays(archive: zipfile.ZipFile, name: str) -> dict[str, Tensor]:
    entries = {entry.filename.removesuffix(".npy"): entry for entry in archive.infolist()}
    if unknown := [key for key in entries if key not in KEYS]:
        raise UserError(f"{name}: no display has a map {unknown[0][:60]!r}; {suggest(unknown[0][:60], KEYS)}")
    if sum(entry.file_size for entry in entries.values()) > LARGEST + HEADERS * len(entries):
        raise UserError(f"{name}: its arrays are larger than {LARGEST / 1e6:g} MB in all")
    return {key: _array(_content(archive, entry), key, name) for key, entry in entries.items()}


def _content(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> bytes:
    """Of an entry, no more than it says: other ways to compress than NumPy's unpack all that there is."""
    if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError(f"'{entry.filename}' is compressed in another way")
    with archive.open(entry) as file:
        return file.read(entry.file_size)


def _array(content: bytes, key: str, name: str) -> Tensor:
    """An array. NumPy's reader would believe what its header promises."""
    file = io.BytesIO(content)
    try:
        with warnings.catch_warnings(action="error"):
            if read_magic(file) != (1, 0):
                raise ValueError("another version")
            shape, columns_first, kind = read_array_header_1_0(file, max_header_size=HEADERS)
            if min(shape, default=0) < 0:
                raise ValueError("a negative side")
    except Exception as error:  # whatever NumPy says of it, with advice that is of no use here
        raise ValueError(f"'{key}' has no header of an array") from error
    if kind != "<f4":
        raise UserError(f"{name}: '{key}' is of the type {kind.str!r}; expected float32, '<f4'")
    if 4 * math.prod(shape) != len(content) - file.tell():
        raise ValueError(f"'{key}' is shorter or longer than its shape")
    values, known = np.frombuffer(content, "<f4", offset=file.tell()), KEYS[key]
    values = values.reshape(shape, order="F" if columns_first else "C")
    if not (np.isfinite(values).all() and known.low <= values.min(initial=known.low)):
        raise UserError(f"{name}: '{key}' has values that are not finite or below {known.low:g}")
    if values.max(initial=known.low) > known.high:
        raise UserError(f"{name}: '{key}' has values above {known.high:g}")
    return torch.from_numpy(np.array(values, np.float32, order="C"))


def enlarged(values: Tensor, shape: tuple[int, int]) -> Tensor:
    """A map ``(h, w)`` at every pixel of a panel ``(H, W)``, bicubically with corners on corners; float64."""
    values = values.double()
    if tuple(values.shape) == shape:
        return values
    return functional.interpolate(values[None, None], size=shape, mode="bicubic", align_corners=True)[0, 0]
