"""A lens that the display adds to every hologram, and the eye that may need it (paper 7.1 and 4.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor

from ....optics.convolution import iris
from ....optics.phase import Matrix, refocus
from ..geometry import Geometry
from ..stage import Stage


@dataclass(frozen=True)
class AddedLens(Stage):
    """A quadratic phase that moves the image from the distance z to z (1 + ``move``).

    move: along rows, along columns and cross term [relative to the distance]. The image is stretched by 1 + move.
    """

    title: ClassVar[str] = "added lens"
    model: ClassVar[str] = "quadratic phase added to every hologram, which moves the image (paper 7.1, 4.2)"

    move: Matrix = (0.0, 0.0, 0.0)

    def hologram(self, geometry: Geometry) -> Tensor | None:
        """Phase ``(H, W)`` [rad]: that of a point at the new distance less that of one at the old one.

        A point at the distance Z asks for -pi x^T Z^-1 x / lambda (paraxial; Goodman, Introduction to Fourier Optics,
        Section 5.1), so the lens is -pi x^T (Z^-1 - z^-1) x / lambda.
        """
        if not any(self.move):
            return None
        rows, columns, cross = self.move
        determinant = (1 + rows) * (1 + columns) - cross**2
        inverse = ((1 + columns) / determinant - 1, (1 + rows) / determinant - 1, -cross / determinant)
        y, x = (axis * geometry.shape[0] * geometry.pitch for axis in geometry.coordinates())
        form = inverse[0] * y * y + inverse[1] * x * x + 2 * inverse[2] * y * x
        wavelength = geometry.wavelength - geometry.detuning  # one hologram for all lines of the source
        return (-math.pi / (wavelength * geometry.distance) * form).float()


@dataclass(frozen=True)
class Eye(Stage):
    """A relaxed eye that sees the plane at z (1 + ``focus``) instead of the image's, through its pupil.

    focus: along rows, along columns and cross term [relative to the distance]; pupil: diameter in the plane of the
    iris, as that of the iris [share of the panel's band], none for one that takes in all light; decentre: of the pupil,
    rows and columns [share of half the band]; known: whether methods know the focus, as they know the nominal optics.
    """

    title: ClassVar[str] = "eye"
    model: ClassVar[str] = "in the place of the camera: relaxed at another distance, meridian by meridian (paper 4.2)"

    focus: Matrix = (0.0, 0.0, 0.0)
    pupil: Annotated[float, Interval(gt=0, le=1)] | None = None
    decentre: tuple[float, float] = (0.0, 0.0)
    known: bool = False

    def transmission(self, fy: Tensor, fx: Tensor, geometry: Geometry) -> Tensor | None:
        """See ``optics.phase.refocus`` and ``optics.convolution.iris``."""
        if not any(self.focus) and self.pupil is None:
            return None
        phase = refocus(self.focus, fy, fx, geometry.wavelength, geometry.distance)
        down, right = (share / (2 * geometry.pitch) for share in self.decentre)
        return torch.polar(iris(fy - down, fx - right, geometry.pitch, self.pupil), phase)
