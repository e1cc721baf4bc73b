"""A letter F as a test picture, and where it is in a photograph: unturned or turned, mirrored or not, or not at all."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
import torch
from torch import Tensor

from ..imaging.warp import Array, Frame

SIDE = 96  # pixels of the longer side of the small picture that is searched
BLUR = 0.012  # of the picture's longer side: beyond the grain of speckle, well below the strokes
SCALES = tuple(0.3 * 1.13**step for step in range(12))  # side of the region over the shorter side of the picture
TURN, FINE_TURN = 10.0, 2.5  # degrees between the orientations that are tried
BORDER = 0.5  # the letter's light beyond this is the letter, below a tenth of it the ground


def draw_pattern(shape: tuple[int, int]) -> Tensor:
    """An F of light ``(h, w)`` float32, 0 or 1, upright in the middle: the simplest letter without any symmetry."""
    height, width = shape
    side = min(shape)
    return torch.from_numpy(_drawn(shape, ((height - 1) / 2, (width - 1) / 2), side, 0.0, False))


@dataclass(frozen=True, eq=False)
class PatternFit:
    """The orientation in which the letter fits a photograph best.

    correlation: of the amplitude of the light with the letter's, 1 at best; mirrored: left and right; turn:
    anticlockwise as one sees it, after the mirror [degrees, -180 to 180]; where: the letter there, 0 to 1, of the
    photograph's shape.
    """

    correlation: float
    mirrored: bool
    turn: float
    where: Frame

    @property
    def quarter(self) -> int:
        """The nearest number of anticlockwise quarter turns, 0 to 3."""
        return round(self.turn / 90) % 4

    def light(self, photograph: Frame) -> float:
        """How much more light the strokes have than the ground around them, in the unit of the photograph."""
        strokes, ground = self.where > BORDER, self.where < BORDER / 10
        return float(photograph[strokes].mean() - photograph[ground].mean())


def find_pattern(photograph: Frame) -> PatternFit:
    """Look for the letter, of any size, place and orientation, in linear light ``(Hs, Ws)`` without dark level.

    The search compares the square root of the blurred light, so that single grains of speckle do not count. It always
    finds a best place; the correlation says what it is worth.
    """
    small = _small(photograph)
    turns = np.arange(-180.0, 180.0, TURN)
    coarse = [
        (*_best_shift(small, scale, turn, mirrored), scale, turn, mirrored)
        for mirrored in (False, True)
        for scale in SCALES
        for turn in turns
    ]
    _, _, scale, turn, mirrored = max(coarse, key=lambda each: each[0])
    fine = [
        (*_best_shift(small, scale * stretch, turn + more, mirrored), scale * stretch, turn + more)
        for stretch in (0.94, 1.0, 1.06)
        for more in np.arange(-TURN, TURN + 1, FINE_TURN)
    ]
    correlation, (y, x), scale, turn = max(fine, key=lambda each: each[0])
    ratio = max(photograph.shape) / max(small.shape)
    centre = ((y + 0.5) * ratio - 0.5, (x + 0.5) * ratio - 0.5)
    where = _drawn(photograph.shape, centre, scale * min(small.shape) * ratio, turn, mirrored)
    return PatternFit(correlation, mirrored, float((turn + 180) % 360 - 180), where)


def _small(photograph: Frame) -> Array:
    """Amplitude of the light on about `SIDE` pixels, of zero mean and unit norm."""
    finer = _shrunk(np.maximum(photograph, 0), 4 * SIDE)  # a photograph of many megapixels is blurred in no time
    small = _shrunk(np.asarray(cv2.GaussianBlur(finer, (0, 0), BLUR * max(finer.shape))), SIDE)
    return _normal(np.sqrt(np.maximum(small.astype(np.float64), 0)))


def _shrunk(picture: Frame, side: int) -> Frame:
    """The picture with a longer side of ``side`` pixels."""
    ratio = side / max(picture.shape)
    size = (max(1, round(picture.shape[1] * ratio)), max(1, round(picture.shape[0] * ratio)))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), dtype=np.float32)


def _normal(picture: Array) -> Array:
    even = picture - picture.mean()
    return np.asarray(even / max(float(np.linalg.norm(even)), 1e-12))


def _best_shift(small: Array, scale: float, turn: float, mirrored: bool) -> tuple[float, tuple[int, int]]:
    """The highest correlation over all places, and the letter's centre (row, column) there."""
    spectrum = _spectrum(small.shape, round(scale * min(small.shape), 3), turn, mirrored)
    scores = np.fft.irfft2(np.fft.rfft2(small) * spectrum, s=small.shape)
    row, column = np.unravel_index(int(np.argmax(scores)), scores.shape)
    return float(scores[row, column]), (int(row), int(column))


@lru_cache(maxsize=2048)
def _spectrum(shape: tuple[int, int], side: float, turn: float, mirrored: bool) -> Array:
    """Conjugate transform of the letter around the first pixel, wrapped."""
    centre = (shape[0] // 2, shape[1] // 2)
    drawn = _normal(_drawn(shape, centre, side, turn, mirrored).astype(np.float64))
    return np.asarray(np.conj(np.fft.rfft2(np.roll(drawn, (-centre[0], -centre[1]), (0, 1)))))


def _drawn(shape: tuple[int, ...], centre: tuple[float, float], side: float, turn: float, mirrored: bool) -> Frame:
    """The letter of a region of ``side`` pixels around ``centre`` (row, column), mirrored and then turned."""
    y, x = (np.arange(size, dtype=np.float32) - middle for size, middle in zip(shape, centre, strict=True))
    y, x = y[:, None], x[None, :]
    angle = math.radians(turn)
    right = (math.cos(angle) * x - math.sin(angle) * y) / side
    down = (math.sin(angle) * x + math.cos(angle) * y) / side
    if mirrored:
        right = -right
    strokes = ((-0.22, -0.09, -0.3, 0.3), (-0.22, 0.23, -0.3, -0.17), (-0.22, 0.12, -0.06, 0.07))
    inside = [
        np.minimum(np.minimum(right - left, end - right), np.minimum(down - top, bottom - down))
        for left, end, top, bottom in strokes
    ]
    return np.clip(np.maximum.reduce(inside) * side + 0.5, 0, 1).astype(np.float32)
