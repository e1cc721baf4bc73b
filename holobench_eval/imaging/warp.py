"""The map from region pixels to sensor pixels of one colour channel, and sampling a frame through it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Frame = NDArray[np.float32]


def quadratic(x: Array, y: Array, shape: tuple[int, int]) -> tuple[Array, ...]:
    """The terms 1, u, v, uu, uv, vv, with u and v from -1 to 1 over a region of ``shape`` (height, width).

    x and y [region px] may be any shapes that broadcast, such as a row and a column.
    """
    u = x / (0.5 * (shape[1] - 1)) - 1
    v = y / (0.5 * (shape[0] - 1)) - 1
    return np.ones_like(u), u, v, u * u, u * v, v * v


def quadratic_terms(points: Array, shape: tuple[int, int]) -> Array:
    """`quadratic` of points ``(N, 2)`` as columns ``(N, 6)``, for a least-squares fit."""
    return np.stack(quadratic(points[:, 0], points[:, 1], shape), axis=1)


def quadratic_surface(coefficients: Array, shape: tuple[int, int]) -> Array:
    """The quadratic with six ``coefficients`` at every pixel of the region, ``(h, w)``."""
    x, y = (np.arange(side, dtype=np.float64) for side in reversed(shape))
    terms = quadratic(x[None, :], y[:, None], shape)
    return np.asarray(sum(c * term for c, term in zip(coefficients, terms, strict=True)))


@dataclass(frozen=True, eq=False)
class Warp:
    """Region pixel x to sensor pixel ``homography (x + quadratic(x))``; pixel centres at integers, x before y.

    shape: (height, width) of the region; homography: ``(3, 3)``; quadratic: ``(6, 2)`` coefficients of
    `quadratic_terms` in region pixels, zero for a relay without distortion.
    """

    shape: tuple[int, int]
    homography: Array
    quadratic: Array

    def to_sensor(self, points: Array) -> Array:
        """Sensor coordinates ``(N, 2)`` of region coordinates ``(N, 2)``."""
        bent = points + quadratic_terms(points, self.shape) @ self.quadratic if self.quadratic.any() else points
        mapped = np.column_stack([bent, np.ones(len(bent))]) @ self.homography.T
        return np.asarray(mapped[:, :2] / mapped[:, 2:])

    def corners(self) -> Array:
        """Sensor coordinates ``(4, 2)`` of the centres of the region's corner pixels."""
        bottom, right = self.shape[0] - 1.0, self.shape[1] - 1.0
        return self.to_sensor(np.array([[0.0, 0.0], [right, 0.0], [0.0, bottom], [right, bottom]]))

    def scale(self) -> float:
        """Sensor pixels per region pixel at the centre of the region."""
        centre = np.array([self.shape[1] - 1.0, self.shape[0] - 1.0]) / 2
        around = self.to_sensor(centre + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
        return float(np.sqrt(abs(np.linalg.det(around[1:] - around[0]))))

    def coordinates(self) -> tuple[Frame, Frame]:
        """Sensor x and y of every region pixel, each ``(h, w)`` float32, as `cv2.remap` takes them."""
        height, width = self.shape
        bent = np.empty((height, width, 2))
        bent[..., 0] = np.arange(width) + quadratic_surface(self.quadratic[:, 0], self.shape)
        bent[..., 1] = np.arange(height)[:, None] + quadratic_surface(self.quadratic[:, 1], self.shape)
        where = cv2.perspectiveTransform(bent, self.homography).astype(np.float32)
        return np.ascontiguousarray(where[..., 0]), np.ascontiguousarray(where[..., 1])

    def sample(self, frame: Frame) -> Frame:
        """A frame ``(Hs, Ws)`` seen in region coordinates, ``(h, w)``."""
        return remap(frame, *self.coordinates())


def remap(frame: Frame, x: Frame, y: Frame) -> Frame:
    """``frame`` at sensor coordinates x, y by cubic interpolation, zero outside."""
    return np.asarray(cv2.remap(frame, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT, borderValue=0.0))
