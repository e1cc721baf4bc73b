"""Bounded rigid refinement of one capture against its target (protocol, point 3)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from .warp import Array, Frame

FURTHEST_SHIFT = 2.0  # region pixels
FURTHEST_TURN = 0.1  # degrees
REFINE_BLUR = 1.0  # region pixels: averages over speckle grains; wide enough a basin for the furthest shift
BORDER = 4  # region pixels that take no part: the furthest shift and the reach of the interpolation
ITERATIONS = 50
STEP = 1e-3  # region pixels, at the corners: a smaller step ends the search


@dataclass(frozen=True)
class Refined:
    """A capture moved onto its target, and the move; all zero when no move within the bounds was found.

    Parameters
    ----------
    image
        ``(C, h, w)``, moved; unchanged without a move.
    dx, dy
        Where the centre of the target was found in the capture, right and down [px].
    theta
        Rotation about the centre from x towards y [degrees].
    """

    image: Tensor
    dx: float
    dy: float
    theta: float


def refine(capture: Tensor, target: Tensor) -> Refined:
    """Align a rectified capture with its target by a bounded rigid move (protocol, point 3).

    One shift and rotation for all channels, at most 2 px and 0.1 degree, that maximises the correlation of the square
    root of the light summed over the channels (the enhanced correlation coefficient of Evangelidis & Psarakis, IEEE
    Trans. Pattern Anal. Mach. Intell. 30, 1858, 2008, for a rigid move). No score takes part. Without convergence,
    outside the bounds or without a gain in correlation, the capture comes back as it is.

    Parameters
    ----------
    capture, target
        ``(C, h, w)`` linear light.

    Raises
    ------
    ValueError
        Shapes that differ or are too small.

    Examples
    --------
    >>> smooth = torch.rand(1, 1, 8, 8, generator=torch.Generator().manual_seed(0))
    >>> target = torch.nn.functional.interpolate(smooth, (64, 64), mode="bicubic")[0].clamp(0, 1)
    >>> refined = refine(target.roll(1, dims=-1), target)
    >>> abs(refined.dx - 1) < 0.05, abs(refined.dy) < 0.05
    (True, True)
    """
    return Refinement(target)(capture)


class Refinement:
    """``refine`` against a target ``(C, h, w)`` that stays: what depends on the target alone is computed once."""

    def __init__(self, target: Tensor) -> None:
        if target.ndim != 3 or min(target.shape[1:]) <= 4 * BORDER:
            raise ValueError(f"target {tuple(target.shape)} must be (C, h, w), both sides above {4 * BORDER} px")
        self.shape = target.shape
        self._amplitude = _amplitude(target)
        self._model = _derivatives(self._amplitude)
        self._normal = self._model.T @ self._model
        self._is_flat = np.linalg.matrix_rank(self._normal) < len(self._normal)

    def __call__(self, capture: Tensor) -> Refined:
        """A capture of the target's shape, moved onto it, as ``refine`` gives it."""
        if capture.shape != self.shape:
            raise ValueError(f"capture {tuple(capture.shape)} and target {tuple(self.shape)} must both be (C, h, w)")
        move = self._search(_amplitude(capture))
        if move is None:
            return Refined(capture, 0.0, 0.0, 0.0)
        where = _coordinates((capture.shape[1], capture.shape[2]), move)
        image = torch.empty_like(capture, dtype=torch.float32)
        for channel, moved in zip(capture.detach(), image, strict=True):
            moved.copy_(torch.from_numpy(_resampled(channel.to("cpu", torch.float32).numpy(), where)))
        return Refined(image, float(move[0]), float(move[1]), math.degrees(move[2]))

    def _search(self, seen: Frame) -> Array | None:
        """The move (dx, dy, theta) [px, px, rad] within the bounds, or None."""
        move, wanted = self._climb(seen), self._amplitude
        if move is None or not _within(move, 1.0):
            return None
        before, after = (_resampled(seen, _coordinates(wanted.shape, each)) for each in (np.zeros(3), move))
        return move if _inner_correlation(after, wanted) > _inner_correlation(before, wanted) else None

    def _climb(self, seen: Frame) -> Array | None:
        """Gauss-Newton from no move, with gain and offset free; None far beyond the bounds or without convergence."""
        if self._is_flat:
            return None
        height, width = self._amplitude.shape
        move: Array = np.zeros(3)
        for _ in range(ITERATIONS):
            now = _inner(_resampled(seen, _coordinates((height, width), move))).ravel()
            solved = np.linalg.solve(self._normal, self._model.T @ now.astype(np.float64))
            if solved[0] <= 0:
                return None
            step = solved[2:] / solved[0]
            move = move + step
            if not _within(move, 3.0):
                return None
            if np.abs(step * (1, 1, max(height, width) / 2)).max() < STEP:
                return np.asarray(move)
        return None


def _amplitude(image: Tensor) -> Frame:
    """Square root of the blurred light: blurred first, as the root of speckled edges would spread into the dark."""
    light = image.detach().to("cpu", torch.float32).sum(0).clamp_min(0.0).numpy()
    return np.sqrt(np.asarray(cv2.GaussianBlur(light, (0, 0), REFINE_BLUR)))


def _derivatives(wanted: Frame) -> Array:
    """What gain, offset, the shifts and the turn change in a picture, its inner pixels by 5."""
    height, width = wanted.shape
    x, y = np.arange(width) - (width - 1) / 2, np.arange(height)[:, None] - (height - 1) / 2
    # Written in place: of a large picture every further array of this size counts.
    model = np.empty((*_inner(wanted).shape, 5))
    model[..., 0], model[..., 1] = _inner(wanted), 1
    slope_y, slope_x = (_inner(np.asarray(slope)) for slope in np.gradient(wanted.astype(np.float64)))
    np.negative(slope_x, out=model[..., 2])
    np.negative(slope_y, out=model[..., 3])
    np.multiply(slope_x, y[BORDER:-BORDER], out=model[..., 4])
    model[..., 4] -= slope_y * x[BORDER:-BORDER]
    return model.reshape(-1, 5)


def _within(move: Array, slack: float) -> bool:
    """Is the move inside ``slack`` times the bounds?"""
    return math.hypot(*move[:2]) <= slack * FURTHEST_SHIFT and abs(math.degrees(move[2])) <= slack * FURTHEST_TURN


def _coordinates(shape: tuple[int, ...], move: Array) -> tuple[Frame, Frame]:
    """Where every pixel of the target lies in the capture: x and y, each ``(h, w)``."""
    dx, dy, theta = move
    centre_y, centre_x = (shape[0] - 1) / 2, (shape[1] - 1) / 2
    x = np.arange(shape[1]) - centre_x
    y = np.arange(shape[0])[:, None] - centre_y
    cosine, sine = math.cos(theta), math.sin(theta)
    moved_x = cosine * x - sine * y + centre_x + dx
    moved_y = sine * x + cosine * y + centre_y + dy
    return moved_x.astype(np.float32), moved_y.astype(np.float32)


def _resampled(frame: Frame, where: tuple[Frame, Frame]) -> Frame:
    """``frame`` at coordinates x, y by cubic interpolation; beyond its border the last pixel repeats."""
    return np.asarray(cv2.remap(frame, *where, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE))


def _inner(image: NDArray[np.floating]) -> NDArray[np.floating]:
    return image[BORDER:-BORDER, BORDER:-BORDER]


def _inner_correlation(a: Frame, b: Frame) -> float:
    # np.corrcoef takes seven copies in double precision.
    first, second = (_inner(side).astype(np.float64).ravel() for side in (a, b))
    first -= first.mean()
    second -= second.mean()
    scale = math.sqrt((first @ first) * (second @ second))
    return float(first @ second) / scale if scale else 0.0
