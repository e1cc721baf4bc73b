"""The convolution of padded fields, compiled for the processor at hand: sixteen lines at a time, zeros known.

Rows are transformed, then each block of sixteen columns is transformed, filtered, transformed back and cropped while it
is in the cache, then rows are transformed back. No padded array is ever formed. Between these three functions, a tile
holds the spectra of rows at sixteen neighbouring columns, a sample of sixteen lines for each row.

The transform is Stockham's (Van Loan, Computational Frameworks for the Fast Fourier Transform, 1992, section 1.7), in
the steps of ``sizes.steps``. Real and imaginary parts lie apart: the inverse transform is the transform with the two
exchanged. Numba compiles the functions once and keeps them on disk; they release Python's lock and start no threads.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .butterflies import LANES, SAMPLE, crossed, filtered_butterfly, joined, split, turned_butterfly

OPTIONS = {"nogil": True, "cache": True, "boundscheck": False, "error_model": "numpy"}
compiled = njit(**OPTIONS)


@compiled
def room(size):
    """Samples that arrays of so many take: one more, and then a multiple of sixteen."""
    return (size // LANES + 1) * LANES


@compiled
def _lines(size):
    return np.zeros(room(size) * SAMPLE, np.float32)


@compiled
def _begin(source, end, x, y, size, radices, factors):
    """All steps but the last of a transform, from ``source`` to x, to y, to x; the array of the result and the other.

    Samples of the source from ``end`` on are zero; the one at ``end`` has to be.
    """
    done, left, at = 1, size, 0
    for radix in radices[:-1]:
        left //= radix
        for p in range(left):
            for q in range(done):
                turned_butterfly(
                    radix, source, q + done * p, done * left, end, x, q + done * radix * p, done, size, factors, at
                )
            at += 2 * (radix - 1)
        done *= radix
        source, x, y, end = x, y, x, size
    return source, x


@compiled
def _finish(source, target, limit, size, radices, factors):
    """The last step; in place where source and target are one. Samples from ``limit`` on are dropped into that one."""
    radix = radices[-1]
    hop, ones = size // radix, len(factors) - 2 * (radix - 1)
    for q in range(hop):
        turned_butterfly(radix, source, q, hop, size, target, q, hop, limit, factors, ones)


@njit("void(f4[::1], i8, i8, i8, i8, f4[::1], i8[::1], i8, i8[::1], f4[::1])", **OPTIONS)
def rows_forward(fields, height, width, first, last, tiles, kept, size, radices, factors):
    """Transform blocks ``first`` to ``last`` of 16 rows of ``fields``, complex values, into ``tiles``."""
    blocks, count = -(-height // LANES), len(kept)
    x, y = _lines(size), _lines(size)
    for block in range(first, last):
        image, row = block // blocks, block % blocks * LANES
        begin, rows = 2 * (image * height + row) * width, min(LANES, height - row)
        for column in range(0, width - LANES + 1, LANES):
            split(fields, begin + 2 * column, 2 * width, rows, x, column)
        for column in range(width // LANES * LANES, width):
            for lane in range(rows):
                for part in range(2):
                    x[column * SAMPLE + part * LANES + lane] = fields[begin + 2 * (lane * width + column) + part]
        x[width * SAMPLE : (width + 1) * SAMPLE] = 0
        spectrum, _ = _begin(x, width, y, x, size, radices, factors)
        _finish(spectrum, spectrum, size, size, radices, factors)
        for k in range(count):
            crossed(spectrum, kept[k] * LANES, tiles, (image * count + k) * room(height) + row)


@njit("void(f4[::1], i8, i8, i8, f4[::1], f4, i8, i8[::1], f4[::1])", **OPTIONS)
def columns(tiles, height, first, last, transfer, sign, size, radices, factors):
    """Filter tiles ``first`` to ``last``: 16 columns each, transformed along them and back."""
    x, y, rows = _lines(size), _lines(size), room(height)
    count = len(transfer) // (size * SAMPLE)
    for tile in range(first, last):
        lines = tiles[tile * rows * SAMPLE : (tile + 1) * rows * SAMPLE]
        lines[height * SAMPLE : (height + 1) * SAMPLE] = 0
        spectrum, other = _begin(lines, height, x, y, size, radices, factors)
        radix = radices[-1]
        hop, at = size // radix, tile % count * size
        for q in range(hop):
            filtered_butterfly(radix, spectrum, q, hop, size, spectrum, q, hop, size, transfer, at, sign)
        field, _ = _begin(spectrum, size, other, spectrum, size, radices, factors)
        _finish(field, lines, height, size, radices, factors)


@njit("void(f4[::1], i8, i8, i8, i8, f4[::1], i8[::1], i8, i8[::1], f4[::1])", **OPTIONS)
def rows_back(tiles, height, width, first, last, fields, kept, size, radices, factors):
    """The way back of ``rows_forward``: of the tiles, whose real and imaginary parts are exchanged."""
    blocks, count = -(-height // LANES), len(kept)
    x, y = _lines(size), _lines(size)
    for block in range(first, last):
        image, row = block // blocks, block % blocks * LANES
        begin, rows = 2 * (image * height + row) * width, min(LANES, height - row)
        if count * LANES < size:
            x[:] = 0
        for k in range(count):
            crossed(tiles, (image * count + k) * room(height) + row, x, kept[k] * LANES)
        field, _ = _begin(x, size, y, x, size, radices, factors)
        _finish(field, field, size, size, radices, factors)
        for column in range(0, width - LANES + 1, LANES):
            joined(field, column, fields, begin + 2 * column, 2 * width, rows)
        for column in range(width // LANES * LANES, width):
            for lane in range(rows):
                for part in range(2):
                    fields[begin + 2 * (lane * width + column) + part] = field[
                        column * SAMPLE + (1 - part) * LANES + lane
                    ]
