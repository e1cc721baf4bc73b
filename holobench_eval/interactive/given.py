"""What users pass: numbers as arrays, tensors or lists, paths and names. What is wrong is told in one line."""

from __future__ import annotations

import warnings
from collections.abc import Collection
from pathlib import Path, PurePath
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor

from ..core.errors import UserError
from ..optics.colour import srgb_decode
from .described import PHASE, SEEN

Numbers = ArrayLike | Tensor
FULL = {"uint8": 255, "uint16": 65535}  # scale of the levels of pictures
CLOSE, MANY = 1e-3, 17  # of a level; fewer different values may be a chart's
LIGHT = "linear light in [0, 1] as floating point; OpenDisplay.target makes it of a picture"
RADIANS = "radians as floating point, as np.angle gives them; the method phases reads files"


def array_of(values: Numbers, what: str) -> NDArray[Any]:
    """The numbers as NumPy has them, on the CPU and without a gradient.

    what: these numbers, in the UserError for lists that are no array. An array comes back as it is, not as a copy.
    """
    if isinstance(values, Tensor):
        try:
            values = values.detach().cpu().resolve_conj().resolve_neg()
            return (values.float() if values.dtype == torch.bfloat16 else values).numpy()  # NumPy has no such type
        except (TypeError, RuntimeError):  # sparse, quantised, or without memory
            raise UserError(f"{what} as a tensor that NumPy cannot read; expected a dense one") from None
    if isinstance(values, np.ma.MaskedArray):
        raise UserError(f"{what} with a mask; expected an array without one, such as values.filled(0)")
    try:
        return np.asarray(values)
    except ValueError:
        raise UserError(f"{what} whose rows differ in length; expected an array") from None


def tensor_of(values: Numbers, what: str, right: str) -> Tensor:
    """Floating-point numbers as a tensor of single precision, in memory of its own.

    what, right: these numbers and what is expected, in the UserError for others: integers may be levels of a panel or
    of a picture as well as counts.
    """
    _refuse_other_kind(values, what, right)
    array = array_of(values, what)
    if array.dtype.kind != "f":
        raise UserError(f"{what} of {array.dtype}; expected {right}")
    return torch.from_numpy(array.astype(np.float32, order="C"))


def _refuse_other_kind(values: object, what: str, right: str) -> None:
    """UserError for a path, and for an array of this package that is a phase in the place of light or the reverse."""
    is_path = isinstance(values, str | PurePath)
    kind = f"path '{values}'" if is_path else getattr(values, "what", "")
    if is_path or (kind and (kind in (PHASE, SEEN)) != (right == RADIANS)):
        raise UserError(f"{what} that is the {kind}; expected {right}")


def capture_of(values: Numbers, what: str, meaning: object) -> Tensor:
    """A capture as linear light, single precision. UserError for numbers that may be light or levels of a picture.

    what: the capture, in the UserError; meaning: of its numbers, ``linear`` or ``srgb``; None: linear, unless they are
    integers.
    """
    if meaning not in (None, "linear", "srgb"):
        raise UserError(f"values: expected 'linear' or 'srgb'; got {meaning!r}")
    _refuse_other_kind(values, what, LIGHT)
    array = array_of(values, what)
    if array.dtype.kind not in ("fiu" if meaning else "f"):
        counts, levels = "values='linear' for counts of light", "values='srgb' for levels of a picture"
        raise UserError(f"{what} of {array.dtype}; expected {counts}, {levels}, or floating point")
    light = torch.from_numpy(array.astype(np.float32, order="C"))
    if meaning != "srgb":
        return light
    encoded = light / FULL.get(array.dtype.name, 1)  # a name has no byte order
    if not (float(encoded.min()) >= 0 and float(encoded.max()) <= 1):  # nor NaN
        raise UserError(f"{what} of {array.dtype}; as sRGB expected uint8, uint16, or floating point in [0, 1]")
    return srgb_decode(encoded)


def warn_of_levels(picture: NDArray[Any], stacklevel: int) -> None:
    """Warn of floating point that holds levels of a picture, as ``plt.imread`` and ``img_as_float`` give them.

    All of them are multiples of 1 / 255, which light is by no chance. stacklevel: as in ``warnings.warn``, of the
    caller.
    """
    if picture.dtype.kind != "f" or not picture.size:
        return
    scaled = picture.astype(np.float64) * FULL["uint8"]
    if np.abs(scaled - scaled.round()).max() > CLOSE or len(np.unique(scaled.round())) < MANY:
        return
    text = "all values are levels of 255, as of a picture in sRGB, and are taken as linear light"
    warnings.warn(f"{text}; levels are given as uint8: (255 * x).round().astype('uint8')", stacklevel=stacklevel + 1)


def as_in_config(value: Any) -> Any:
    """A parameter as a config would give it: a path as text, numbers of NumPy's as those of Python.

    All else stays as it is; what no config could hold is refused where the method is built.
    """
    if isinstance(value, PurePath):
        return str(value)
    return value.tolist() if isinstance(value, np.generic | np.ndarray) else value


def path_of(value: object, what: str) -> Path:
    """A path. what: the parameter, in the UserError for what is none."""
    if not isinstance(value, str | PurePath):
        raise UserError(f"{what}: expected a path; got {type(value).__name__}")
    if "\0" in str(value):
        raise UserError(f"{what}: {str(value)!r} is no path, since it holds a zero byte")
    return Path(value)


def whole(value: object, what: str) -> int:
    """A whole number. what: the parameter, in the UserError for what is none."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise UserError(f"{what}: expected a whole number; got {type(value).__name__}")
    return int(value)


def names(value: object, what: str) -> tuple[str, ...]:
    """Names. what: the parameter, in the UserError for one name alone and for what are none."""
    if isinstance(value, str) or not isinstance(value, Collection) or not all(isinstance(name, str) for name in value):
        raise UserError(f'{what}: expected names in a list, such as ["psnr"]; got {value!r}')
    return tuple(value)
