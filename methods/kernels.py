"""What every pixel goes through in a step of phase retrieval, compiled: one pass a row.

Rows of a field ``(..., 2 W)`` hold real and imaginary parts in turn. All is float32.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import compiled, compiled_sums
from ..optics.kernel.elementary import sincos

Floats = NDArray[np.float32]
F = np.float32


@compiled
def unit_rows(field: Floats, phase: Floats) -> None:
    """``exp(i phase)`` of rows ``(rows, W)`` [rad] into a field."""
    for r in range(phase.shape[0]):
        for c in range(phase.shape[1]):
            sine, cosine = sincos(phase[r, c])
            field[r, 2 * c], field[r, 2 * c + 1] = cosine, sine


@compiled
def gradient_rows(field: Floats, phase: Floats, gradient: Floats) -> None:
    """``Im(exp(-i phase) field)`` of rows into ``(rows, W)``."""
    for r in range(phase.shape[0]):
        for c in range(phase.shape[1]):
            sine, cosine = sincos(phase[r, c])
            gradient[r, c] = cosine * field[r, 2 * c + 1] - sine * field[r, 2 * c]


@compiled
def adam_rows(
    phase: Floats, gradient: Floats, mean: Floats, square: Floats, betas: Any, step: float, epsilon: float
) -> None:
    """A step of Adam on rows ``(rows, W)``; step and epsilon: with the corrections of both moments' bias."""
    slow, slower = F(1 - betas[0]), F(1 - betas[1])
    for r in range(phase.shape[0]):
        for c in range(phase.shape[1]):
            g = gradient[r, c]
            mean[r, c] += slow * (g - mean[r, c])
            square[r, c] += slower * (g * g - square[r, c])
            phase[r, c] -= F(step) * mean[r, c] / (np.sqrt(square[r, c]) + F(epsilon))


@compiled_sums
def product_rows(image: Floats, corner: Any, target: Floats, first: int, last: int, sums: Any) -> None:
    """Sums of I T, I I and T T along rows ``first`` to ``last`` of a region, into ``(rows, 3)``.

    I is ``|image|^2`` of a field ``(B, H, 2 W)``, its region at ``corner``; T is the target ``(B, h, w)``, the rows of
    all images are numbered.
    """
    top, left = corner
    height, width = target.shape[1:]
    for line in range(first, last):
        field, wanted = image[line // height, top + line % height, 2 * left :], target[line // height, line % height]
        overlap = size = wanted_size = F(0)
        for c in range(width):
            real, imaginary = field[2 * c], field[2 * c + 1]
            intensity = real * real + imaginary * imaginary
            overlap += intensity * wanted[c]
            size += intensity * intensity
            wanted_size += wanted[c] * wanted[c]
        sums[line, 0], sums[line, 1], sums[line, 2] = overlap, size, wanted_size


@compiled_sums
def residual_rows(
    image: Floats, corner: Any, target: Floats, scale: Floats, slope: Floats, first: int, last: int, sums: Any
) -> None:
    """Sums of ``(s I - T)^2`` along rows, of all rows of the images; the image becomes ``slope (s I - T) image`` in the
    region and zero outside. scale: s of each image; for the rest see ``product_rows``."""
    top, left = corner
    height, width = target.shape[1:]
    for line in range(first, last):
        number, row = line // image.shape[1], line % image.shape[1] - top
        field = image[number, row + top]
        if row < 0 or row >= height:
            field[:] = 0
            sums[line] = 0
            continue
        field[: 2 * left] = 0
        field[2 * (left + width) :] = 0
        field, wanted = field[2 * left :], target[number, row]
        s, factor, error = scale[number], slope[number], F(0)
        for c in range(width):
            real, imaginary = field[2 * c], field[2 * c + 1]
            residual = s * (real * real + imaginary * imaginary) - wanted[c]
            error += residual * residual
            residual *= factor
            field[2 * c], field[2 * c + 1] = residual * real, residual * imaginary
        sums[line] = error
