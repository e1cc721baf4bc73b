"""A second aligner, which shares no algorithm with the first: does it put the region in the same place?

The first one detects circles, or features; this one knows nothing of either. It takes from the first only about where
to look, correlates blocks of the picture with the known one, from the whole region down to small blocks, and fits a
homography to their displacements. A score that depends on which of the two is right is not a score of the hologram.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from skimage.registration import phase_cross_correlation

from .warp import Array, Frame, Warp, quadratic_terms

GRAIN_BLUR = 0.7  # region pixels: gathers some of the speckle grains
WIDE = 12.0  # region pixels: what is smoother is illumination
DIVISIONS = (1, 2, 4, 4, 6)  # of the region's sides in a block's, from a shift of the whole to a homography of many
SMALLEST_BLOCK = 24  # pixels a side of a block
FINENESS = 20  # steps of a displacement in a pixel
FURTHEST_BLOCK = 0.25  # of a block's side: what moves further was not found
LEAST_CORRELATION = 0.35  # correlation of picture and reference at the end, below which there is no opinion
MARGIN = 0.1  # of the region's larger side is sampled around it: the furthest error of the first that is exposed
REWEIGHTINGS = 6
TYPICAL = 0.15  # region pixels: displacements further from the common homography than this count less and less


@dataclass(frozen=True)
class Blocks:
    """Displacements ``(N, 2)`` [region px] of blocks around ``centres`` ``(N, 2)``, with ``weights`` ``(N, 2, 2)``.

    A weight is an inverse covariance but for a factor: along an edge a block says nothing of where it is.
    """

    centres: Array
    displacements: Array
    weights: Array


def second_warp(frame: Frame, reference: Frame, first: Warp) -> Warp | None:
    """Where ``reference`` ``(h, w)`` is seen in ``frame`` ``(Hs, Ws)``, both in linear light; None: no opinion.

    first: what is to be checked, within a tenth of the region's side of the truth. A distortion is fitted anew where
    ``first`` has one. Raises `ValueError` when the reference has not the shape of the region.
    """
    if reference.shape != first.shape:
        raise ValueError(f"reference {reference.shape} and region {first.shape} must have one shape")
    wanted = _relief(reference)
    axes = (np.linspace(0, side - 1, 7) for side in reversed(first.shape))
    points = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    nearest = np.asarray(cv2.findHomography(points, first.to_sensor(points), 0)[0], dtype=np.float64)
    warp = Warp(first.shape, nearest, np.zeros((6, 2)))
    for parts in DIVISIONS:
        moved = _displaced_blocks(frame, wanted, warp, parts)
        if moved is None:
            return None
        correction = _correction(moved, warp.shape, terms=2 if parts == 1 else 6 if parts == 2 else 8)
        warp = replace(warp, homography=warp.homography @ correction)
    if first.quadratic.any():
        for _ in range(2):
            moved = _displaced_blocks(frame, wanted, warp, DIVISIONS[-1])
            if moved is None:
                return None
            warp = replace(warp, quadratic=warp.quadratic + _quadratic(moved, warp.shape))
    border = _margin(warp.shape)
    seen = _relief(_with_margin(frame, warp, border))[border:-border, border:-border]
    correlation = np.corrcoef(seen.ravel(), wanted.ravel())[0, 1]
    return warp if correlation >= LEAST_CORRELATION else None


def disagreement(first: Warp, second: Warp) -> float:
    """Largest distance [region px] between where two warps put a corner of the region."""
    apart = np.linalg.norm(first.corners() - second.corners(), axis=1)
    return float(apart.max() / first.scale())


def _margin(shape: tuple[int, int]) -> int:
    return round(MARGIN * max(shape))


def _with_margin(frame: Frame, warp: Warp, border: int) -> Frame:
    """The region and ``border`` pixels around it as ``warp`` sees them; the edge of the frame repeats outside it."""
    height, width = warp.shape
    where = np.empty((height + 2 * border, width + 2 * border, 2), dtype=np.float32)
    for row in range(len(where)):  # at once, the points of a large region would fill the memory
        x = np.arange(-border, width + border, dtype=np.float64)
        where[row] = warp.to_sensor(np.column_stack([x, np.full(len(x), row - float(border))]))
    smooth = np.asarray(cv2.GaussianBlur(frame, (0, 0), 0.4 * warp.scale()))
    return np.asarray(
        cv2.remap(smooth, where[..., 0], where[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    )


def _relief(light: Frame) -> Frame:
    """Square root of blurred light, without what is smoother than `WIDE`."""
    light = np.asarray(cv2.GaussianBlur(np.maximum(light, 0).astype(np.float32), (0, 0), GRAIN_BLUR))
    amplitude = np.sqrt(light)
    return np.asarray(amplitude - cv2.GaussianBlur(amplitude, (0, 0), WIDE))


def _displaced_blocks(frame: Frame, wanted: Frame, warp: Warp, parts: int) -> Blocks | None:
    """How far blocks of a ``parts``-th of the region's sides lie from where ``warp`` has them; None: too few found."""
    border = _margin(warp.shape)
    seen = _relief(_with_margin(frame, warp, border))
    if not seen.std() > 0:
        return None
    if parts == 1:
        centre = np.array([[warp.shape[1] - 1.0, warp.shape[0] - 1.0]]) / 2
        return Blocks(centre, _shift(seen, np.pad(wanted, border), 1)[None], np.eye(2)[None])
    seen = seen[border:-border, border:-border]
    rows, columns = (_spans(side, parts) for side in warp.shape)
    blocks = [_block(seen, wanted, row, column) for row in rows for column in columns]
    kept = [block for block in blocks if block is not None]
    if len(kept) < max(4, len(blocks) // 4):
        return None
    centres, displacements, weights = (np.array(part) for part in zip(*kept, strict=True))
    return Blocks(centres, displacements, weights)


def _shift(seen: NDArray[np.floating], wanted: NDArray[np.floating], fineness: int) -> Array:
    """How far ``seen`` lies from ``wanted``, x and y, in steps of 1 / ``fineness`` pixel."""
    correlate: Callable[..., tuple[Array, float, float]] = phase_cross_correlation
    shift, _, _ = correlate(seen, wanted, normalization=None, upsample_factor=fineness)
    return np.array(shift[::-1], dtype=np.float64)


def _spans(side: int, parts: int) -> list[tuple[int, int]]:
    """Half-overlapping spans, each at least `SMALLEST_BLOCK` long."""
    length = max(SMALLEST_BLOCK, side // parts)
    count = max(2, 2 * side // length - 1)
    return [(int(start), int(start) + length) for start in np.linspace(0, side - length, count)]


def _block(
    seen: Frame, wanted: Frame, row: tuple[int, int], column: tuple[int, int]
) -> tuple[Array, Array, Array] | None:
    """Centre, displacement and weight of one block, or None where it has nothing to hold on to."""
    window = np.s_[row[0] : row[1], column[0] : column[1]]
    taper = np.outer(np.hanning(row[1] - row[0]), np.hanning(column[1] - column[0]))
    a, b = ((part[window] - part[window].mean()) * taper for part in (seen, wanted))
    if min(a.std(), b.std()) < 1e-6 * max(wanted.std(), 1e-12):
        return None
    displacement = _shift(a, b, FINENESS)
    if np.any(np.abs(displacement) > FURTHEST_BLOCK * np.array([column[1] - column[0], row[1] - row[0]])):
        return None
    matrix = np.array([[1.0, 0.0, displacement[0]], [0.0, 1.0, displacement[1]]])
    back = cv2.warpAffine(a, matrix, a.shape[::-1], flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
    correlation = float(np.clip(np.corrcoef(np.asarray(back).ravel(), b.ravel())[0, 1], 0.05, 0.99))
    slope_y, slope_x = np.gradient(b)
    slopes = np.stack([slope_x.ravel(), slope_y.ravel()])
    weight = slopes @ slopes.T / float(np.sum(b**2)) * correlation**2 / (1 - correlation**2)
    centre = np.array([column[0] + column[1] - 1.0, row[0] + row[1] - 1.0]) / 2
    return centre, displacement, weight


def _solved(model: Array, blocks: Blocks) -> Array:
    """Parameters ``(P,)`` of a linear ``model`` ``(N, 2, P)`` of the displacements, outliers counting little."""
    trust = np.ones(len(blocks.centres))
    parameters = np.zeros(model.shape[2])
    for _ in range(REWEIGHTINGS):
        weights = blocks.weights * trust[:, None, None]
        normal = np.einsum("nip,nij,njq->pq", model, weights, model)
        right = np.einsum("nip,nij,nj->p", model, weights, blocks.displacements)
        parameters = np.linalg.lstsq(normal, right, rcond=1e-9)[0]
        left = np.linalg.norm(blocks.displacements - model @ parameters, axis=1)
        spread = max(TYPICAL, 1.5 * float(np.median(left)))
        trust = 1 / (1 + (left / spread) ** 2) ** 2
    return np.asarray(parameters)


def _correction(blocks: Blocks, shape: tuple[int, int], terms: int) -> Array:
    """The correction ``(3, 3)`` in region pixels; 2 terms: a shift, 6: affine, 8: a homography, to first order."""
    half = np.array([shape[1] - 1.0, shape[0] - 1.0]) / 2
    x, y = ((blocks.centres - half) / half.max()).T
    zeros, ones = np.zeros_like(x), np.ones_like(x)
    right = [ones, zeros, x, y, zeros, zeros, x * x, x * y]
    down = [zeros, ones, zeros, zeros, x, y, x * y, y * y]
    model = np.stack([np.stack(right[:terms], axis=1), np.stack(down[:terms], axis=1)], axis=1)
    p = np.zeros(8)
    p[:terms] = _solved(model, blocks) / half.max()
    small = np.array([[1 + p[2], p[3], p[0]], [p[4], 1 + p[5], p[1]], [-p[6], -p[7], 1.0]])
    unit = np.array([[1.0, 0.0, -half[0]], [0.0, 1.0, -half[1]], [0.0, 0.0, half.max()]]) / half.max()
    return np.asarray(np.linalg.inv(unit) @ small @ unit)


def _quadratic(blocks: Blocks, shape: tuple[int, int]) -> Array:
    """Coefficients ``(6, 2)`` of a quadratic distortion."""
    terms = quadratic_terms(blocks.centres, shape)
    zero = np.zeros_like(terms)
    model = np.stack([np.concatenate([terms, zero], axis=1), np.concatenate([zero, terms], axis=1)], axis=1)
    return _solved(model, blocks).reshape(2, 6).T
