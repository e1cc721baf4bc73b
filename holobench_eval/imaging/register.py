"""Where the scored region lands on the sensor, from one capture of a fiducial grid (protocol, point 2).

The steps: find the circles (`circles`), a RANSAC homography, sub-pixel offsets of every circle (`subpixel`), and a
quadratic distortion where it lowers the residual by more than chance would. All offsets come from local correlation
with the known grid; an enhanced-correlation fit of the whole picture at once was tried and is less exact on speckle
and under uneven light (0.17 instead of 0.14 px at the corners at speckle contrast 1, 0.10 instead of 0.03 px without).

Last it is asked whether what was found is the grid that was shown: whole, single, and of this shape. Every lattice of
circles with an F fits some registration. Two things give the others away: light that the grid does not have (a second
grid in between), and circles that go on where this grid has ended (a larger grid).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
import torch
from scipy.special import fdtri
from torch import Tensor

from ..core.errors import CellError
from .circles import find_circles
from .grid import FiducialGrid
from .subpixel import correlation, even_picture, offsets
from .warp import Array, Frame, Warp, quadratic_terms, remap

FIT_ITERATIONS = 3
CIRCLE_OUTLIER = 1.5  # region pixels from the homography: not speckle but dust, or not a circle at all
FURTHEST_CORNER = 2.0  # region pixels that the sub-pixel fit may move a corner from where the detector put it
SIGNIFICANCE = 0.999
WORTHWHILE = 0.85  # of the residual: fringes of 10 % alone can look like a distortion that lowers it to 0.89
GRID_CORRELATION = 0.85  # with the template: the grid itself has 0.92 and more, two grids in one picture below 0.8
GOES_ON = 0.3  # of a circle's light around the grid: its own is below 0.1, a larger grid's 0.9, a second grid's 0.5
FEW = 90  # percent of the places around the grid; bright dirt may lie on the others


@dataclass(frozen=True, eq=False)
class Registration:
    """Region to sensor, one `Warp` a channel, and how well the grid's circles fit it.

    Parameters
    ----------
    warps
        One a channel.
    residual
        Per channel, root mean square over the circles of the distance between where a circle is measured and where the
        warp puts it [region px]. Speckle moves single circles, so that the warp, fitted to all, is several times more
        exact than its residual.
    """

    warps: tuple[Warp, ...]
    residual: tuple[float, ...]

    def rectify(self, linear: Tensor) -> Tensor:
        """A capture in the frame of the region.

        Cubic interpolation at the region's pixel centres, positions to 1/32 sensor pixel (`cv2.remap`), zero outside
        the sensor. There is no low-pass filter: like the panel model, the result samples the intensity, so a
        sensor finer than the panel keeps its full speckle contrast.

        Parameters
        ----------
        linear
            ``(C, Hs, Ws)`` linear light.

        Returns
        -------
        Tensor
            ``(C, h, w)``, same device, float32.

        Raises
        ------
        CellError
            Another number of channels.
        """
        if linear.ndim != 3 or linear.shape[0] != len(self.warps):
            raise CellError(
                f"a capture of shape {tuple(linear.shape)} does not fit a registration of {len(self.warps)} channels"
            )
        frames = linear.detach().to("cpu", torch.float32).numpy()
        region = [remap(frame, *where) for frame, where in zip(frames, self._coordinates, strict=True)]
        return torch.from_numpy(np.stack(region)).to(linear.device)

    @cached_property
    def _coordinates(self) -> tuple[tuple[Frame, Frame], ...]:
        return tuple(warp.coordinates() for warp in self.warps)


def register(image: Tensor, grid: FiducialGrid, bound: float = 0.3) -> Registration:
    """Register a camera from the capture of the grid's hologram (protocol, point 2).

    Parameters
    ----------
    image
        ``(C, Hs, Ws)`` linear light, dark level subtracted.
    grid
        The grid that was shown.
    bound
        Largest residual [region px, rms].

    Raises
    ------
    CellError
        The grid is not found, lies partly outside the sensor, is not the one that was shown, or fits worse than the
        bound: with the channel and the reason.

    Examples
    --------
    >>> from holobench_eval.imaging import fiducial
    >>> grid = fiducial((160, 160))
    >>> registration = register(torch.nn.functional.pad(grid.image, (20, 20, 20, 20))[None], grid)
    >>> registration.rectify(torch.ones(1, 200, 200)).shape, max(registration.residual) < 0.05
    (torch.Size([1, 160, 160]), True)
    """
    if image.ndim != 3 or not bool(torch.isfinite(image).all()):
        raise CellError(f"registration needs a finite capture (C, Hs, Ws), got shape {tuple(image.shape)}")
    frames = image.detach().to("cpu", torch.float32).numpy()
    fits = [_register_channel(frame, grid, channel) for channel, frame in enumerate(frames)]
    for channel, (_, residual) in enumerate(fits):
        if not residual <= bound:
            raise CellError(
                f"registration of channel {channel} leaves {residual:.2f} px RMS, more than the bound of {bound} px"
            )
    return Registration(tuple(warp for warp, _ in fits), tuple(residual for _, residual in fits))


def _register_channel(frame: Frame, grid: FiducialGrid, channel: int) -> tuple[Warp, float]:
    points = find_circles(frame, grid)
    if points is None:
        raise CellError(
            f"registration of channel {channel}: no grid of {grid.columns}x{grid.rows} circles and its marks is seen"
        )
    start = Warp(grid.shape, _homography(grid.centres, points, 3 * CIRCLE_OUTLIER), np.zeros((6, 2)))
    warp = _refined(frame, start, grid)
    corners = warp.corners()
    height, width = frame.shape
    if np.any(corners < -0.5) or np.any(corners > (width - 0.5, height - 0.5)):
        raise CellError(f"registration of channel {channel}: the region lies partly outside the sensor")
    doubt = mismatch(frame, warp, grid)
    if doubt is not None:
        raise CellError(f"registration of channel {channel}: {doubt}")
    residual = offsets(even_picture(frame, warp, grid), grid)
    return warp, float(np.sqrt(np.mean(np.sum(residual**2, axis=1))))


def _refined(frame: Frame, start: Warp, grid: FiducialGrid) -> Warp:
    """The sub-pixel fit, or ``start`` when it does not raise the correlation or moves a corner too far."""
    warp = start
    for _ in range(FIT_ITERATIONS):
        moved = offsets(even_picture(frame, warp, grid), grid)
        correction = _homography(grid.centres, grid.centres + moved, CIRCLE_OUTLIER)
        warp = replace(warp, homography=warp.homography @ correction)
    warp = _bent(frame, warp, grid)
    moved_corners = np.linalg.norm(warp.corners() - start.corners(), axis=1).max() / start.scale()
    before, after = (correlation(even_picture(frame, each, grid), grid) for each in (start, warp))
    return warp if after > before and moved_corners <= FURTHEST_CORNER else start


def _homography(source: Array, target: Array, outlier: float) -> Array:
    homography, _ = cv2.findHomography(source, target, cv2.RANSAC, outlier)
    if homography is None:
        raise CellError("registration: the circles lie on no common plane")
    return np.asarray(homography, dtype=np.float64)


def _bent(frame: Frame, warp: Warp, grid: FiducialGrid) -> Warp:
    """The warp with a quadratic distortion, where the circles show one: by an F-test, and by more than fringes do."""
    terms = quadratic_terms(grid.centres, grid.shape)
    moved = offsets(even_picture(frame, warp, grid), grid)
    coefficients = np.linalg.lstsq(terms, moved, rcond=None)[0]
    without, remaining = float(np.sum(moved**2)), float(np.sum((moved - terms @ coefficients) ** 2))
    extra, free = 4, moved.size - 12  # a quadratic has 12 coefficients, 8 of which the homography already fitted
    ratio = (without - remaining) / extra / max(remaining / free, 1e-12)
    significant = ratio >= float(fdtri(extra, free, SIGNIFICANCE))
    if not significant or remaining > WORTHWHILE**2 * without:
        return warp
    bent = replace(warp, quadratic=warp.quadratic + coefficients)
    for _ in range(FIT_ITERATIONS - 1):
        moved = offsets(even_picture(frame, bent, grid), grid)
        bent = replace(bent, quadratic=bent.quadratic + np.linalg.lstsq(terms, moved, rcond=None)[0])
    return bent


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
