"""How many samples a propagation needs: a stated accuracy, with its price."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Literal

import numpy as np

from .kernel.sizes import fast_size

Padding = int | Literal["reference"] | None

DEFAULT_ERROR = 0.9e-2
"""Relative rms error on a white complex field that the default padding is chosen for (it states 1e-2)."""

REFERENCE_ERROR = 1.2e-3
"""The same for the reference padding where light spreads over more than the picture; it states 2e-3."""

IRIS_EDGE = 0.05
"""Half width of the iris's raised-cosine edge, relative to its radius."""


def spread(pitch: float, wavelength: float, distance: float, pupil: float | None = None) -> float:
    """Pixels that light travels to each side: ``K = z tan(asin(lambda / 2p)) / p``.

    Parameters
    ----------
    pitch, wavelength, distance
        Lengths [m].
    pupil
        Diameter of an iris as a fraction of the band, which it scales; None for no iris.

    Returns
    -------
    float
        Pixels.

    Examples
    --------
    >>> round(spread(pitch=6.4e-6, wavelength=517e-9, distance=0.02))
    126
    """
    band = 1.0 if pupil is None else min(pupil * (1 + IRIS_EDGE), 1.0)
    sine = min(band * wavelength / (2 * pitch), 0.99)
    return abs(distance) * math.tan(math.asin(sine)) / pitch


def tail_error(size: int, spread_pixels: float, padded: int) -> float:
    """Relative rms error, on a white field, of the light that wraps around one axis of a ``padded`` transform.

    The band of a sampled field ends in a kink at its Nyquist frequency, so beyond the spread K the impulse
    response falls only as ``(2.2 K / pi) / (d^2 - K^2)`` (stationary phase; the factor is measured, and the
    estimate is never below the error measured against an eight times padded transform for sizes 128 to 512
    and K from 0.2 to 5 times the size).
    """
    offset = np.arange(size, dtype=np.float64)
    distance = padded - offset
    response = (2.2 * spread_pixels / np.pi) / np.maximum(distance**2 - spread_pixels**2, 1.0)
    kept = 1 - spread_pixels / (2 * size) if spread_pixels < size else size / (2 * spread_pixels)
    return math.sqrt(2 * float(np.sum((1 - offset / size) * response**2)) / kept)


@lru_cache(maxsize=256, typed=True)  # True is refused, though it equals 1
def padded_size(
    size: int, spread_pixels: float, soft_edge: int | None, padding: Padding, error: float = DEFAULT_ERROR
) -> int:
    """Samples of the transform that propagates the pixels of an axis, rounded up to a fast FFT size.

    Parameters
    ----------
    size
        Pixels.
    spread_pixels
        See ``spread``.
    soft_edge
        Samples that the tails of the soft edge of an iris inside the band take: ``N + K + soft_edge`` is enough then.
        None: no such iris.
    padding
        None: the smallest size whose tail error is below ``error``, both axes together. "reference": four times the
        size, more when the light spreads further. An integer: samples added.
    error
        Relative rms, see ``tail_error``.

    Raises
    ------
    ValueError
        Another padding.
    """
    if padding == "reference":
        padded = 4 * size
        while spread_pixels > size and tail_error(size, spread_pixels, padded) > REFERENCE_ERROR / math.sqrt(2):
            padded = fast_size(padded + size // 2)
        return padded
    if padding is not None:
        if isinstance(padding, bool) or not isinstance(padding, int) or padding < 0:
            raise ValueError(f"padding must be None, 'reference' or a whole number of samples >= 0, got {padding!r}")
        return fast_size(size + padding)
    padded = size + math.ceil(spread_pixels) + (soft_edge or 16)
    while soft_edge is None and tail_error(size, spread_pixels, padded) > error / math.sqrt(2):
        padded += 1 + padded // 256
    return fast_size(padded)


def padded_shape(
    shape: tuple[int, int],
    pitch: float,
    wavelength: float,
    distance: float,
    pupil: float | None,
    padding: Padding,
    error: float = DEFAULT_ERROR,
) -> tuple[int, int]:
    """(rows, columns) of the transform that propagates a field of ``shape``; lengths in metres, see ``padded_size``."""
    reach = spread(pitch, wavelength, distance, pupil)
    inside = pupil is not None and pupil * (1 + IRIS_EDGE) <= 1
    # the edge's width in frequency shrinks with the iris, and its tails in the image grow with the inverse
    edge = math.ceil(25.6 / pupil) if inside and pupil is not None else None
    return padded_size(shape[0], reach, edge, padding, error), padded_size(shape[1], reach, edge, padding, error)
