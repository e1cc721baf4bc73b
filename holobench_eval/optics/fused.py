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

from .butterflies import SAMPLE, crossed, filtered_butterfly, filtered_sample, joined, split, turned_butterfly
from .sizes import LANES

OPTIONS = {"nogil": True, "cache": True, "boundscheck": False, "error_model": "numpy"}
SHAPE, STEPS = "UniTuple(i8, 3)", "Tuple((i8, i8[::1], f4[::1]))"
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


@compiled
def _gaps(starts, size):
    """Whether a line has samples that are in none of the blocks."""
    end = 0
    for start in starts:
        if start > end:
            return True
        end = start + LANES
    return end < size


@njit(f"void(f4[::1], {SHAPE}, i8[::1], i8, i8, f4[::1], i8[::1], {STEPS})", **OPTIONS)
def rows_forward(fields, shape, blocks, first, last, tiles, starts, steps):
    """Transform the ``first`` to ``last`` of some blocks of 16 rows of ``fields``, complex values, into ``tiles``.

    shape: (planes, height, width) of fields ``(images, planes, planes, height, width)``, the planes of which interleave
    in an image of as many samples a pixel and axis; blocks of an image are numbered by row of planes, then by row;
    starts: the first of the sixteen samples of a row's spectrum in each tile.
    """
    planes, height, width = shape
    size, radices, factors = steps
    each, count, rest = -(-height // LANES), len(starts), width // LANES * LANES
    x, y = _lines(size), _lines(size)
    for block in blocks[first:last]:
        line, row = block // each, block % each * LANES
        rows = min(LANES, height - row)
        for plane in range(planes):
            begin = 2 * ((line * planes + plane) * height + row) * width
            for column in range(0, rest, LANES):
                split(fields, begin + 2 * column, 2 * width, rows, x, column * planes + plane, planes)
            for column in range(rest, width):
                sample = (column * planes + plane) * SAMPLE
                for lane in range(rows):
                    for part in range(2):
                        x[sample + part * LANES + lane] = fields[begin + 2 * (lane * width + column) + part]
        x[planes * width * SAMPLE : (planes * width + 1) * SAMPLE] = 0
        spectrum, _ = _begin(x, planes * width, y, x, size, radices, factors)
        _finish(spectrum, spectrum, size, size, radices, factors)
        place = line // planes * count * planes * room(height) + row * planes + line % planes
        for k in range(count):
            crossed(spectrum, starts[k], 1, tiles, place + k * planes * room(height), planes)


@njit(
    f"void(f4[::1], i8[::1], {SHAPE}, {STEPS}, f4[::1], i8[::1], {SHAPE}, {STEPS}, i8, i8, f4[::1], i8, f4, b1)",
    **OPTIONS,
)
def columns(
    source, taken, shape, steps, target, put, target_shape, target_steps, first, last, transfer, band, sign, add
):
    """Filter tiles: 16 columns each, transformed along them and back, on another grid where the target has one.

    taken, put: of which the ``first`` to ``last`` are done: the tile of the source and that of the target, to which
    the result is added with ``add``; band: frequencies of the filter, those around zero that both grids have.
    """
    size, radices, factors = steps
    target_size, target_radices, target_factors = target_steps
    height, rows = shape[0] * shape[1], shape[0] * room(shape[1])
    target_height, target_rows = target_shape[0] * target_shape[1], target_shape[0] * room(target_shape[1])
    x, y = _lines(max(size, target_size)), _lines(max(size, target_size))
    count, low, high = len(transfer) // (band * SAMPLE), (band + 1) // 2, band // 2
    for k in range(first, last):
        lines = source[taken[k] * rows * SAMPLE : (taken[k] + 1) * rows * SAMPLE]
        lines[height * SAMPLE : (height + 1) * SAMPLE] = 0
        spectrum, other = _begin(lines, height, x, y, size, radices, factors)
        at = k % count * band
        if size == band and target_size == band:
            radix = radices[-1]
            hop = size // radix
            for q in range(hop):
                filtered_butterfly(radix, spectrum, q, hop, size, spectrum, q, hop, size, transfer, at, sign)
        else:
            _finish(spectrum, spectrum, size, size, radices, factors)
            other[low * SAMPLE : (target_size - high) * SAMPLE] = 0
            for q in range(low):
                filtered_sample(spectrum, q, other, q, transfer, at + q, sign)
            for q in range(-high, 0):
                filtered_sample(spectrum, size + q, other, target_size + q, transfer, at + band + q, sign)
            spectrum, other = other, spectrum
        field, _ = _begin(spectrum, target_size, other, spectrum, target_size, target_radices, target_factors)
        lines = target[put[k] * target_rows * SAMPLE : (put[k] + 1) * target_rows * SAMPLE]
        if add:
            _finish(field, field, target_size, target_size, target_radices, target_factors)
            for place in range(target_height * SAMPLE):
                lines[place] += field[place]
        else:
            _finish(field, lines, target_height, target_size, target_radices, target_factors)


@njit(f"void(f4[::1], {SHAPE}, i8[::1], i8, i8, f4[::1], i8[::1], {STEPS})", **OPTIONS)
def rows_back(fields, shape, blocks, first, last, tiles, starts, steps):
    """The way back of ``rows_forward``: of the tiles, whose real and imaginary parts are exchanged."""
    planes, height, width = shape
    size, radices, factors = steps
    each, count, rest = -(-height // LANES), len(starts), width // LANES * LANES
    x, y, gaps = _lines(size), _lines(size), _gaps(starts, size)
    for block in blocks[first:last]:
        line, row = block // each, block % each * LANES
        rows = min(LANES, height - row)
        if gaps:
            x[:] = 0
        place = line // planes * count * planes * room(height) + row * planes + line % planes
        for k in range(count):
            crossed(tiles, place + k * planes * room(height), planes, x, starts[k], 1)
        field, _ = _begin(x, size, y, x, size, radices, factors)
        _finish(field, field, size, size, radices, factors)
        for plane in range(planes):
            begin = 2 * ((line * planes + plane) * height + row) * width
            for column in range(0, rest, LANES):
                joined(field, column * planes + plane, planes, fields, begin + 2 * column, 2 * width, rows)
            for column in range(rest, width):
                sample = (column * planes + plane) * SAMPLE
                for lane in range(rows):
                    for part in range(2):
                        place = begin + 2 * (lane * width + column) + part
                        fields[place] = field[sample + (1 - part) * LANES + lane]
