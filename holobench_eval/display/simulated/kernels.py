"""What every pixel of the panel and of the sensor goes through, compiled: one pass a row, its temporaries in the cache.

Functions without loops also work on whole arrays, where Numba is not installed.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.compiled import compiled
from ...optics.kernel.elementary import sincos

Plane = NDArray[np.float32]

F, N, U = np.float32, np.int32, np.uint32  # constants of these types keep float32 what it is
TURN = 2 * math.pi
LOW, HALF_WORD = np.uint64(2**32 - 1), np.uint64(32)


def philox(column: Any, row: Any, key: tuple[Any, Any]) -> tuple[Any, Any, Any, Any]:
    """Four random words of 32 bits for a counter (column, row) and a key, all uint64.

    Philox4x32-10: J. K. Salmon, M. A. Moraes, R. O. Dror, D. E. Shaw, "Parallel random numbers: as easy as 1, 2, 3",
    Proc. SC (2011).
    """
    a, b, c, d = column, row, column & np.uint64(0), column & np.uint64(0)
    first, second = key
    for _ in range(10):
        left, right = np.uint64(0xD2511F53) * a, np.uint64(0xCD9E8D57) * c
        a, b, c, d = (right >> HALF_WORD) ^ b ^ first, right & LOW, (left >> HALF_WORD) ^ d ^ second, left & LOW
        first, second = (first + np.uint64(0x9E3779B9)) & LOW, (second + np.uint64(0xBB67AE85)) & LOW
    return a, b, c, d


def counts(charge: Any, normal: Any, read: Any, bend: Any, gain: Any, dark: Any, white: Any) -> Any:
    """Counts [DN] of a charge [electrons] with its noise; see ``Sensor.expose``. read: variance of the read noise;
    bend: relative loss of response an electron."""
    charge = charge + normal * np.sqrt(np.maximum(charge, F(0)) + read)
    return np.minimum(np.maximum(np.rint((charge - bend * (charge * charge)) * gain + dark), F(0)), white)


_philox, _counts = compiled(philox), compiled(counts)


@compiled
def log(x: Any) -> Any:
    """Natural logarithm of a positive number, float32, within 1e-7 of its size or of 1; vectorised as ``sincos``."""
    bits = np.float32(x).view(np.int32)
    exponent = (bits - N(0x3F3504F3)) >> N(23)  # of two, so that what remains lies in [sqrt(1/2), sqrt(2))
    f = np.int32(bits - (exponent << N(23))).view(np.float32) - F(1)
    p = F(-0.13279585) + f * (F(0.12873202) + f * F(-0.07488439))
    p = F(0.33333345) + f * (F(-0.2500131) + f * (F(0.20000998) + f * (F(-0.16608536) + f * (F(0.14193764) + f * p))))
    return f - f * f * (F(0.5) - f * p) + F(exponent) * F(math.log(2))


@compiled
def words(row: int, key: Any, out: Any) -> None:
    """Random words of a row, ``(4, columns)``."""
    for i in range(out.shape[1]):
        a, b, c, d = _philox(np.uint64(i), np.uint64(row), key)
        out[0, i], out[1, i], out[2, i], out[3, i] = U(a), U(b), U(c), U(d)


@compiled
def pairs(distance: Any, direction: Any, x: Any, y: Any) -> None:
    """Two normal numbers from two words each (Box and Muller)."""
    for i in range(x.size):
        radius = np.sqrt(F(-2) * log((F(N(distance[i] >> U(8))) + F(0.5)) * F(2**-24)))
        sine, cosine = sincos(F(N(direction[i])) * F(TURN * 2**-32))
        x[i], y[i] = radius * cosine, radius * sine


@compiled
def normal_rows(first: int, key: Any, out: Any) -> None:
    """Normal numbers ``(rows, 4, columns)`` of the rows from ``first`` on."""
    random = np.empty(out.shape[1:], np.uint32)
    for r in range(out.shape[0]):
        words(first + r, key, random)
        pairs(random[0], random[1], out[r, 0], out[r, 1])
        pairs(random[2], random[3], out[r, 2], out[r, 3])


@compiled
def count_rows(
    light: Plane, response: Plane, normal: Plane, electrons: float, ambient: float, numbers: Any, out: Plane
) -> None:
    """Counts of ``light`` ``(rows, columns)``; see ``Sensor.expose``."""
    read, bend, gain, dark, white = numbers
    for r in range(out.shape[0]):
        for c in range(out.shape[1]):
            charge = response[r, c] * (light[r, c] * F(electrons) + F(ambient))
            out[r, c] = _counts(charge, normal[r, c], F(read), F(bend), F(gain), F(dark), F(white))


@compiled
def weigh(at: Any, last: int, pixel: Any, low: Any, high: Any) -> None:
    """The first of the two pixels on both sides of places ``at``, in reach, and the weights of both; zero outside."""
    for c in range(at.size):
        first = np.floor(at[c]) if at[c] > F(0) else F(0)  # NaN too: a pixel of the image
        first = first if first < F(last - 1) else F(last - 1)
        pixel[c] = N(first)
        low[c], high[c] = max(F(1) - abs(at[c] - first), F(0)), max(F(1) - abs(at[c] - first - F(1)), F(0))


@compiled
def sample_rows(image: Plane, grid: Plane, out: Plane) -> None:
    """Bilinear values of an image at a grid ``(rows, columns, 2)`` of (x, y) in [-1, 1]; see ``relay.sample``."""
    rows, columns = image.shape
    size, one = grid.shape[1], np.uint64(1)
    x, y = np.empty(size, np.float32), np.empty(size, np.float32)
    left, right, above, below = (np.empty_like(x), np.empty_like(x), np.empty_like(x), np.empty_like(x))
    column, row = np.empty(size, np.int32), np.empty(size, np.int32)
    for r in range(grid.shape[0]):
        for c in range(size):
            x[c] = (grid[r, c, 0] + F(1)) * F((columns - 1) / 2)
            y[c] = (grid[r, c, 1] + F(1)) * F((rows - 1) / 2)
        weigh(x, columns - 1, column, left, right)
        weigh(y, rows - 1, row, above, below)
        for c in range(size):
            j, i = np.uint64(row[c]), np.uint64(column[c])  # unsigned: not counted from the end
            upper = image[j, i] * left[c] + image[j, i + one] * right[c]
            lower = image[j + one, i] * left[c] + image[j + one, i + one] * right[c]
            out[r, c] = upper * above[c] + lower * below[c]


@compiled
def box_rows(image: Plane, taps: Plane, first: int, last: int, out: Plane) -> None:
    """Rows ``first`` to ``last`` of an image filtered by ``taps`` along both axes, beyond its edges as at them."""
    height, width = image.shape
    reach = taps.size // 2
    line, total = np.empty(width + 2 * reach, F), np.empty(width, F)
    for r in range(first, last):
        total[:] = 0
        for k in range(taps.size):
            row = image[min(max(r + k - reach, 0), height - 1)]
            for c in range(width):
                total[c] += taps[k] * row[c]
        line[:reach], line[reach : reach + width], line[reach + width :] = total[0], total, total[width - 1]
        for c in range(width):
            out[r, c] = 0
        for k in range(taps.size):
            for c in range(width):
                out[r, c] += taps[k] * line[c + k]


@compiled
def box_back_rows(grad: Plane, taps: Plane, first: int, last: int, out: Plane) -> None:
    """The adjoint of ``box_rows``."""
    height, width = grad.shape
    reach = taps.size // 2
    line = np.empty(width + 2 * reach, np.float32)
    out[first:last] = 0
    for r in range(max(first - reach, 0), min(last + reach, height)):
        line[:] = 0
        for k in range(taps.size):
            for c in range(width):
                line[c + k] += taps[k] * grad[r, c]
        for k in range(reach):
            line[reach] += line[k]
            line[reach + width - 1] += line[reach + width + k]
        for k in range(taps.size):
            row = min(max(r + k - reach, 0), height - 1)
            if first <= row < last:
                for c in range(width):
                    out[row, c] += taps[k] * line[c + reach]


@compiled
def show_row(phase: Plane, added: Plane, levels: Any, level: Any, out: Plane) -> None:
    """Gray levels ``(W,)`` of a row of the panel; out: zero, or NaN where there is none."""
    for c in range(phase.size):
        steps = np.rint((phase[c] + added[c]) * F(levels / TURN))
        wrapped = steps - F(levels) * np.floor(steps / F(levels))
        level[c] = N(wrapped if wrapped > F(0) else F(0))  # NaN too: an entry of the table
        out[c] = F(0) * wrapped


@compiled
def modulate_rows(lit: Any, table: Plane, modulated: Plane, first: int, last: int, out: Plane) -> None:
    """The light of the sub-samples in rows ``first`` to ``last`` of the panel; see ``PanelLight.field``.

    lit: phase, what is added to it, gain of each pixel and of the frame, shares of the neighbours ``(2, samples,
    taps)``, light that follows no phase ``(samples, samples, 2)`` and incident light ``(H, 2 W)``; table: phase [rad]
    of each gray level; out ``(samples, samples, last - first, 2 W)``. Complex numbers are real and imaginary parts in
    turn.
    """
    phase, added, gain, factor, taps, unmodulated, incident = lit
    height, width = phase.shape
    samples, reach, rows = taps.shape[1], taps.shape[2] // 2, last - first
    driven, level = np.empty((rows + 2 * reach, width + 2 * reach), np.float32), np.empty(width, np.int32)
    for r in range(len(driven)):
        row, line = min(max(first + r - reach, 0), height - 1), driven[r, reach : reach + width]
        show_row(phase[row], added[row], table.size, level, line)
        for c in range(width):
            line[c] = (gain[row, c] * F(factor) + line[c]) * table[U(level[c])]
        driven[r, :reach] = driven[r, reach]
        driven[r, reach + width :] = driven[r, reach + width - 1]
    line, fine = np.empty(width + 2 * reach, np.float32), np.empty(width, np.float32)
    for r in range(rows):
        light = incident[first + r]
        for j in range(samples):
            line[:] = 0
            for k in range(taps.shape[2]):
                for c in range(line.size):
                    line[c] += taps[0, j, k] * driven[r + k, c]
            for i in range(samples):
                fine[:] = 0
                for k in range(taps.shape[2]):
                    for c in range(width):
                        fine[c] += taps[1, i, k] * line[c + k]
                share, real, imaginary = modulated[j, i], unmodulated[j, i, 0], unmodulated[j, i, 1]
                for c in range(width):
                    sine, cosine = sincos(fine[c])
                    a, b = share * cosine + real, share * sine + imaginary
                    out[j, i, r, 2 * c] = a * light[2 * c] - b * light[2 * c + 1]
                    out[j, i, r, 2 * c + 1] = a * light[2 * c + 1] + b * light[2 * c]


@compiled
def modulate_back_rows(lit: Any, slope: Plane, grad: Plane, field: Plane, first: int, last: int, out: Plane) -> None:
    """Gradient in the phase, in rows ``first`` to ``last``, from that in the ``field`` that ``modulate_rows`` gave.

    slope: of the phase of each gray level in that of the hologram. Light that follows no phase is taken off the field.
    """
    phase, added, gain, factor, taps, unmodulated, incident = lit
    height, width = phase.shape
    samples, reach = taps.shape[1], taps.shape[2] // 2
    total = np.zeros((last - first, width + 2 * reach), np.float32)
    line, fine = np.empty(width + 2 * reach, np.float32), np.empty(width, np.float32)
    for r in range(max(first - reach, 0), min(last + reach, height)):
        light = incident[r]
        for j in range(samples):
            line[:] = 0
            for i in range(samples):
                real, imaginary = unmodulated[j, i, 0], unmodulated[j, i, 1]
                for c in range(width):
                    a = field[j, i, r, 2 * c] - (real * light[2 * c] - imaginary * light[2 * c + 1])
                    b = field[j, i, r, 2 * c + 1] - (real * light[2 * c + 1] + imaginary * light[2 * c])
                    fine[c] = grad[j, i, r, 2 * c + 1] * a - grad[j, i, r, 2 * c] * b
                for k in range(taps.shape[2]):
                    for c in range(width):
                        line[c + k] += taps[1, i, k] * fine[c]
            for k in range(taps.shape[2]):
                row = min(max(r + k - reach, 0), height - 1) - first
                if 0 <= row < last - first:
                    for c in range(line.size):
                        total[row, c] += taps[0, j, k] * line[c]
    level = np.empty(width, np.int32)
    for r in range(last - first):
        row, seen = first + r, total[r]
        for k in range(reach):
            seen[reach] += seen[k]
            seen[reach + width - 1] += seen[reach + width + k]
        show_row(phase[row], added[row], slope.size, level, fine)
        for c in range(width):
            out[row, c] = seen[reach + c] * (gain[row, c] * F(factor) + fine[c]) * slope[U(level[c])]
