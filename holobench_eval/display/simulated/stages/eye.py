"""Stage 9, for an eye in the place of the camera: the distance at which it is relaxed, meridian by meridian."""

from __future__ import annotations

import math
from dataclasses import dataclass

from torch import Tensor

from .lens import Matrix


@dataclass(frozen=True)
class Eye:
    """A relaxed eye that sees the plane at z (1 + ``focus``) instead of the image's.

    focus: a matrix; astigmatism gives each meridian a distance of its own. See ``conditions.vision``. known: whether
    methods know the eye, as they know the nominal optics.
    """

    focus: Matrix = (0.0, 0.0, 0.0)
    known: bool = False


def eye_phase(focus: Matrix, fy: Tensor, fx: Tensor, wavelength: float, distance: float) -> Tensor:
    """Phase [rad] that light of spatial frequency (fy, fx) [1/m] gains on the way to the plane of ``Eye.focus``.

    Paraxial: -pi lambda z f^T focus f; wavelength and distance z in metres.
    """
    rows, columns, cross = focus
    return -math.pi * wavelength * distance * (rows * fy * fy + columns * fx * fx + 2 * cross * fy * fx)
