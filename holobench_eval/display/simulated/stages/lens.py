"""Stage 1, before the panel: a lens that the display adds to every hologram (paper 7.1, and 4.2 for an eye)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from torch import Tensor

from ....optics.phase import Matrix
from .geometry import Geometry


@dataclass(frozen=True)
class AddedLens:
    """A quadratic phase that moves the image from the distance z to z (1 + ``move``).

    move: a matrix, since a cylinder moves the foci of vertical and horizontal lines differently. The image is
    stretched by 1 + move.
    """

    move: Matrix = (0.0, 0.0, 0.0)

    def phase(self, geometry: Geometry) -> Tensor:
        """Phase ``(H, W)`` [rad]: that of a point at the new distance less that of one at the old one.

        A point at the distance Z asks for -pi x^T Z^-1 x / lambda (paraxial; Goodman, Introduction to Fourier Optics,
        Section 5.1), so the lens is -pi x^T (Z^-1 - z^-1) x / lambda.
        """
        rows, columns, cross = self.move
        determinant = (1 + rows) * (1 + columns) - cross**2
        inverse = ((1 + columns) / determinant - 1, (1 + rows) / determinant - 1, -cross / determinant)
        y, x = (axis * geometry.shape[0] * geometry.pitch for axis in geometry.coordinates())
        form = inverse[0] * y * y + inverse[1] * x * x + 2 * inverse[2] * y * x
        return (-math.pi / (geometry.wavelength * geometry.distance) * form).float()
