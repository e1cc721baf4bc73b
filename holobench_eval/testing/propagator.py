"""A propagator under test: a stranger's, from a file, through the smallest interface that the kit needs."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np
import torch
from torch import Tensor

from ..core.errors import UserError, reason, suggest
from ..core.sources import import_file
from .propagation_reference import Physics, Setting

BAND = 0.9
"""Share of the band of the pixels, on each axis, that a propagator is taken to carry if it claims no other."""

Make = Callable[[tuple[int, int], float, float, float], Any]
"""``make(shape, pitch, wavelength, distance)``, lengths in metres, gives a propagator: see docs/propagation.md."""


class NotApplicableError(Exception):
    """Why a check has nothing to say of a propagator."""


class WrongResultError(Exception):
    """What is wrong with something that a propagator returned."""


@dataclass(frozen=True)
class Subject:
    """A propagator under test, and what it claims: its physics, and the share of the band that it carries."""

    make: Make
    physics: Physics = "exact"
    band: float = BAND

    def model(self, setting: Setting) -> Any:
        """The propagator made for a setting."""
        return self.make(setting.shape, setting.pitch, setting.wavelength, setting.distance)

    def propagate(self, field: Tensor, setting: Setting) -> Tensor:
        """The field ``(H, W)`` at the setting's distance, as this propagator has it; complex128."""
        return _field(_forward(self.model(setting), _given(field)), setting.shape)


def load_subject(source: str) -> Subject:
    """The propagator that ``path/to/file.py:Name`` names; UserError, in one line, where there is none."""
    file, colon, name = source.rpartition(":")
    if not (colon and file.endswith(".py") and name.isidentifier()):
        raise UserError(f"propagator '{source}' is not of the form path/to/file.py:Name")
    path = Path(file)
    if not path.is_file():
        raise UserError(f"propagator '{source}': no such file: {path}")
    try:
        module = import_file(path)
    except (Exception, SystemExit) as error:
        raise UserError(f"propagator '{source}': the file fails to import: {reason(error)}") from error
    make = getattr(module, name, None)
    if not callable(make):
        own = [key for key, value in vars(module).items() if getattr(value, "__module__", None) == module.__name__]
        raise UserError(f"propagator '{source}': {path} has no class or function '{name}'; {suggest(name, own)}")
    try:
        inspect.signature(make).bind((64, 64), 6.4e-6, 517e-9, 0.02)
    except TypeError as error:
        wanted = f"{name}(shape, pitch, wavelength, distance)"
        raise UserError(f"propagator '{source}' cannot be called as {wanted}: {error}") from error
    except ValueError:
        pass  # one of C, which tells no signature: where it cannot be called so, each check that calls it says so
    physics: Any = getattr(make, "physics", "exact")
    band: Any = getattr(make, "band", BAND)
    if physics not in get_args(Physics):
        raise UserError(f"propagator '{source}': physics is {physics!r}; allowed: {', '.join(get_args(Physics))}")
    if isinstance(band, bool) or not isinstance(band, int | float) or not 0 < band <= 1:
        raise UserError(f"propagator '{source}': band is {band!r}, not a share in (0, 1]")
    return Subject(make, physics, float(band))


def adjoint(model: Any, field: Tensor, at: Tensor) -> Tensor:
    """The adjoint of a propagator applied to a field, both ``(H, W)``; complex128.

    By its ``adjoint``, or else by autograd through ``forward`` at the field ``at``.

    Raises
    ------
    NotApplicableError
        Neither is to be had.
    """
    shape = (field.shape[0], field.shape[1])
    if hasattr(model, "adjoint"):
        return _field(model.adjoint(_given(field)), shape)
    light = _given(at)
    image = _forward(model, light.clone())
    if not isinstance(image, Tensor):
        raise NotApplicableError(f"no adjoint, and no gradient through {type(image).__module__.split('.')[0]}")
    light.requires_grad_()
    try:
        image = _forward(model, light.clone())
    except RuntimeError as error:
        if "requires grad" not in str(error):
            raise
        raise NotApplicableError("no adjoint, and forward leaves torch, so that there is no gradient") from error
    if not image.requires_grad:
        raise NotApplicableError("no adjoint, and no gradient reaches the field")
    (back,) = torch.autograd.grad(image, light, grad_outputs=field.to(image), allow_unused=True)
    if back is None:
        raise NotApplicableError("no adjoint, and no gradient reaches the field")
    return _field(back, shape)


def _forward(model: Any, field: Tensor) -> Any:
    return model.forward(field) if hasattr(model, "forward") else model(field)


def _given(field: Tensor) -> Tensor:
    """A field as every propagator is given it: complex64, and a copy, which may be written to."""
    return field.detach().to(torch.complex64, copy=True)


def _field(result: Any, shape: tuple[int, int]) -> Tensor:
    """A propagator's result for some light, a tensor or an array of NumPy or JAX, as complex128."""
    tensor = result.detach() if isinstance(result, Tensor) else torch.from_numpy(np.array(result))
    if tuple(tensor.shape) != shape or not tensor.is_complex():
        kind = str(tensor.dtype).removeprefix("torch.")
        raise WrongResultError(f"the result is {kind} of shape {tuple(tensor.shape)}, not a complex field {shape}")
    if not bool(tensor.isfinite().all()):
        raise WrongResultError("the result is not finite: it has NaN or infinite values")
    if not bool(tensor.any()):
        raise WrongResultError("the result is nothing but zeros")
    return tensor.to("cpu", torch.complex128)
