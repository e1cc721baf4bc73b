"""Whether what registration found is the grid that was shown: whole, single, and of this shape.

Every lattice of circles with an F fits some registration. Two things give the others away: light that the grid does
not have (a second grid in between), and circles that go on where this grid has ended (a larger grid).
"""

from __future__ import annotations

import cv2
import numpy as np

from .grid import FiducialGrid
from .subpixel import correlation, even_picture
from .warp import Array, Frame, Warp

GRID_CORRELATION = 0.85  # with the template: the grid itself has 0.92 and more, two grids in one picture below 0.8
GOES_ON = 0.3  # of a circle's light around the grid: its own is below 0.1, a larger grid's 0.9, a second grid's 0.5
FEW = 90  # percent of the places around the grid; bright dirt may lie on the others


def mismatch(frame: Frame, warp: Warp, grid: FiducialGrid) -> str | None:
    """Why ``frame`` ``(Hs, Ws)``, seen through ``warp``, shows something else than ``grid``: one line, or None."""
    agreement = correlation(even_picture(frame, warp, grid), grid)
    if not agreement >= GRID_CORRELATION:
        return (
            f"what was found is not this grid alone: its correlation with it is {agreement:.2f}, not {GRID_CORRELATION}"
        )
    if _beyond(frame, warp, grid) > GOES_ON:
        return f"the circles go on beyond {grid.columns}x{grid.rows}: this is the grid of another region"
    return None


def _beyond(frame: Frame, warp: Warp, grid: FiducialGrid) -> float:
    """Light where the lattice's next circles around the grid would be, above that between them; 1: as in a circle."""
    x, y = grid.centres[: grid.columns, 0], grid.centres[:: grid.columns, 1]
    step = grid.spacing
    columns = np.concatenate([[x[0] - step], x, [x[-1] + step]])
    rows = np.concatenate([[y[0] - step], y, [y[-1] + step]])
    across = np.stack(np.meshgrid(columns, rows[[0, -1]]), axis=-1).reshape(-1, 2)
    down = np.stack(np.meshgrid(columns[[0, -1]], rows[1:-1]), axis=-1).reshape(-1, 2)
    inside = _rise(frame, warp, grid, grid.centres)
    around = _rise(frame, warp, grid, np.concatenate([across, down]))
    around = around[np.isfinite(around)]
    return float(np.percentile(around, FEW) / np.median(inside)) if len(around) else 0.0


def _rise(frame: Frame, warp: Warp, grid: FiducialGrid, centres: Array) -> Array:
    """Light in circles around ``centres`` ``(N, 2)`` less that half-way to their diagonal neighbours, NaN outside."""
    y, x = np.mgrid[-2:3, -2:3].reshape(2, -1) * (grid.radius / 4)
    disc = np.stack([x, y], axis=-1)
    half = np.array([[-0.5, -0.5], [-0.5, 0.5], [0.5, -0.5], [0.5, 0.5]]) * grid.spacing
    between = [_light(frame, warp, centres + corner, disc) for corner in half]
    return _light(frame, warp, centres, disc) - np.mean(between, axis=0)


def _light(frame: Frame, warp: Warp, centres: Array, around: Array) -> Array:
    where = warp.to_sensor((centres[:, None] + around).reshape(-1, 2)).astype(np.float32).reshape(len(centres), -1, 2)
    seen = cv2.remap(
        frame, where[..., 0], where[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=float("nan")
    )
    return np.asarray(np.asarray(seen).mean(axis=1), dtype=np.float64)
