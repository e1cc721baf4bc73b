"""The fiducial grid: bright circles whose hologram shows where the scored region lands on the sensor."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ..core.errors import UserError

RADIUS = 0.28  # of the spacing
MARK_RADIUS = 0.39  # of the spacing
MARGIN = 0.7  # of the spacing, from the outermost centres to the region's border
SMALLEST_REGION = 96  # pixels a side


@dataclass(frozen=True)
class FiducialGrid:
    """Circles on a square lattice, some of them larger, so that the pattern equals none of its mirrors and turns.

    image: ``(h, w)`` linear light in [0, 1]; centres: ``(N, 2)`` float64, x and y in region pixels (pixel centres at
    integers), row by row; marks: ``(N,)`` bool, true for the larger circles, which draw a letter F;
    spacing, radius, mark_radius: region pixels.
    """

    image: Tensor
    centres: NDArray[np.float64]
    marks: NDArray[np.bool_]
    columns: int
    rows: int
    spacing: float
    radius: float
    mark_radius: float

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) of the region in pixels."""
        return int(self.image.shape[0]), int(self.image.shape[1])


def fiducial(shape: tuple[int, int]) -> FiducialGrid:
    """The grid of circles for a region.

    Many small circles locate better than a few large ones, but a circle has to be several speckle grains wide, and
    the search for the lattice slows down with the cube of their number: 64 circles at 160x160 pixels, about 300 at
    1080x1920.

    Parameters
    ----------
    shape
        Rows and columns of the region.

    Raises
    ------
    UserError
        A region too small for the marks.

    Examples
    --------
    >>> grid = fiducial((160, 160))
    >>> grid.columns, grid.rows, grid.centres.shape
    (8, 8, (64, 2))
    """
    height, width = shape
    if min(shape) < SMALLEST_REGION:
        raise UserError(
            f"a region of {height}x{width} px is too small for a fiducial grid; at least {SMALLEST_REGION} px a side"
        )
    spacing = max(16.0, 18.0 * (min(shape) / 160) ** 0.75)
    columns, rows = (int((side - 1 - 2 * MARGIN * spacing) // spacing) + 1 for side in (width, height))
    x = (width - 1) / 2 + spacing * (np.arange(columns) - (columns - 1) / 2)
    y = (height - 1) / 2 + spacing * (np.arange(rows) - (rows - 1) / 2)
    centres = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    marks = _letter_f(columns, rows).ravel()
    radii = np.where(marks, MARK_RADIUS, RADIUS) * spacing
    return FiducialGrid(
        image=_discs(shape, centres, radii),
        centres=centres,
        marks=marks,
        columns=columns,
        rows=rows,
        spacing=spacing,
        radius=RADIUS * spacing,
        mark_radius=MARK_RADIUS * spacing,
    )


def _letter_f(columns: int, rows: int) -> NDArray[np.bool_]:
    """An F over the lattice: the simplest letter without any symmetry."""
    marks = np.zeros((rows, columns), dtype=bool)
    marks[:, 0] = True
    marks[0, : math.ceil(0.7 * columns)] = True
    marks[rows // 2, : math.ceil(0.4 * columns)] = True
    return marks


def _discs(shape: tuple[int, int], centres: NDArray[np.float64], radii: NDArray[np.float64]) -> Tensor:
    """Discs of light with an edge two pixels wide: soft enough for the band of a display with an iris."""
    image = np.zeros(shape)
    y, x = np.mgrid[: shape[0], : shape[1]]
    for (cx, cy), radius in zip(centres, radii, strict=True):
        top, left = (max(0, int(c - radius - 2)) for c in (cy, cx))
        window = np.s_[top : int(cy + radius + 3), left : int(cx + radius + 3)]
        distance = np.hypot(x[window] - cx, y[window] - cy)
        image[window] = np.maximum(image[window], np.clip((radius - distance) / 2 + 0.5, 0, 1))
    return torch.from_numpy(image.astype(np.float32))
