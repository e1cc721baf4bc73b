"""The convolution of padded fields, compiled for the processor at hand: sixteen lines at a time, zeros known.

Rows are transformed, then each block of sixteen columns is transformed, filtered, transformed back and cropped while it
is in the cache, then rows are transformed back. No padded array is ever formed. Between these three functions, a tile
holds the spectra of rows at sixteen neighbouring columns, a sample of sixteen lines for each row.

Fields may be sampled more finely than the band of the filter asks for, by planes of samples that interleave. The
spectrum in the band is then the sum of those of the planes, each times weights that shift it to its place; what a
longer transform would give beyond the band is never computed.

The transform is Stockham's (Van Loan, Computational Frameworks for the Fast Fourier Transform, 1992, section 1.7), in
the steps of ``sizes.steps``. Real and imaginary parts lie apart: the inverse transform is the transform with the two
exchanged. Numba compiles the functions once and keeps them on disk; they release Python's lock and start no threads.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .butterflies import (
    adding_butterfly,
    filtered_butterfly,
    filtered_sample,
    joining_butterfly,
    turned_butterfly,
    weighted_sample,
)
from .lanes import SAMPLE
from .sizes import LANES
from .transpositions import crossed, joined, split, squared

OPTIONS = {"nogil": True, "cache": True, "boundscheck": False, "error_model": "numpy"}
SHAPE, AXIS = "UniTuple(i8, 3)", "Tuple((i8, i8[::1], f4[::1], f4[::1]))"
compiled = njit(**OPTIONS)


@compiled
def room(size):
    """Samples that arrays of so many take: one more, and then a multiple of sixteen."""
    return (size // LANES + 1) * LANES


@compiled
def _lines(size):
    return np.zeros(room(size) * SAMPLE, np.float32)


@compiled
def _begin(source, first, step, end, x, y, size, radices, factors):
    """All steps but the last of a transform, from ``source`` to x, to y, to x; the array of the result and the other.

    Every ``step``-th sample of the source from ``first`` on is read. Those from ``end`` on are zero; the one at ``end``
    has to be.
    """
    done, left, at = 1, size, 0
    for radix in radices[:-1]:
        left //= radix
        for p in range(left):
            for q in range(done):
                begin, start = first + (q + done * p) * step, q + done * radix * p
                turned_butterfly(radix, source, begin, done * left * step, end, x, start, done, size, factors, at)
            at += 2 * (radix - 1)
        done *= radix
        source, x, y, first, step, end = x, y, x, 0, 1, size
    return source, x


@compiled
def _finish(source, target, first, step, limit, size, radices, factors):
    """The last step, to every ``step``-th sample of the target from ``first`` on; those from ``limit`` on are dropped
    into that one. In place where source and target are one."""
    radix = radices[-1]
    hop, ones = size // radix, len(factors) - 2 * (radix - 1)
    for q in range(hop):
        turned_butterfly(radix, source, q, hop, size, target, first + q * step, hop * step, limit, factors, ones)


@compiled
def _add(source, target, plane, size, radices, weights):
    """The last step; the result is added to the target, times the weights of a plane."""
    radix = radices[-1]
    hop = size // radix
    for q in range(hop):
        adding_butterfly(radix, source, q, hop, size, target, q, hop, size, weights, 2 * size * (plane - 1))


@compiled
def _weighted(source, target, plane, size, weights):
    """A spectrum times the weights of a plane, in the target; the source itself for the first plane."""
    if plane == 0:
        return source
    for k in range(size):
        weighted_sample(source, target, k, weights, 2 * size * (plane - 1))
    return target


@compiled
def _planes(weights, size):
    """Planes that interleave along an axis; the first has no weights."""
    return 1 + len(weights) // (2 * size)


@compiled
def _gaps(starts, size):
    """Whether a line has samples that are in none of the blocks."""
    end = 0
    for start in starts:
        if start > end:
            return True
        end = start + LANES
    return end < size


@njit(f"void(f4[::1], i8, i8, {SHAPE}, i8[::1], i8, i8, f4[::1], i8, i8[::1], {AXIS})", **OPTIONS)
def rows_forward(fields, top, held, shape, blocks, first, last, tiles, tile, starts, axis):
    """Transform the ``first`` to ``last`` of some blocks of 16 rows of ``fields``, complex values, into ``tiles``.

    top, held: rows of each plane that ``fields`` holds; shape: (planes, height, width) of fields ``(images, planes,
    planes, height, width)``, the planes of which interleave in an image; samples of a row of an image of one plane
    may themselves be those of the planes of ``axis``, in turn; blocks of an image are numbered by row of planes, then
    by row; tile: samples of a tile; starts: the first of the sixteen samples of a row's spectrum in each tile; axis:
    size, radices and factors of ``sizes.steps``, and weights ``(planes - 1, size)``.
    """
    planes, height, width = shape
    size, radices, factors, weights = axis
    each, count, rest = -(-height // LANES), len(starts), width // LANES * LANES
    all_planes = _planes(weights, size)
    step = all_planes // planes
    line, y = _lines(max(size, width)), _lines(size)
    x = line if step == 1 else _lines(size)
    total = _lines(size if all_planes > 1 else 0)
    for block in blocks[first:last]:
        across, row = block // each, block % each * LANES
        rows = min(LANES, height - row)
        for plane in range(planes):
            begin = 2 * ((across * planes + plane) * held + row - top) * width
            for column in range(0, rest, LANES):
                split(fields, begin + 2 * column, 2 * width, rows, line, column, 1)
            for column in range(rest, width):
                for lane in range(rows):
                    for part in range(2):
                        line[column * SAMPLE + part * LANES + lane] = fields[begin + 2 * (lane * width + column) + part]
            line[width * SAMPLE : (width + 1) * SAMPLE] = 0
            for within in range(step):
                spectrum, _ = _begin(line, within, step, width, y, x, size, radices, factors)
                if plane + within > 0:
                    _add(spectrum, total, plane + within, size, radices, weights)
                    continue
                if all_planes == 1:
                    total = spectrum
                _finish(spectrum, total, 0, 1, size, size, radices, factors)
        place = across // planes * count * tile + row * planes + across % planes
        for k in range(count):
            crossed(total, starts[k], 1, tiles, place + k * tile, planes)


@njit(
    f"void(f4[::1], i8, i8[::1], i8, {AXIS}, f4[::1], i8, i8[::1], i8, {AXIS}, i8, i8, f4[::1], f4, b1, f4[::1], i8, "
    "i8[::1])",
    **OPTIONS,
)
def columns(
    source, tile, taken, height, axis, target, target_tile, put, target_height, target_axis, first, last, transfer,
    sign, keep, kept, kept_tile, joins,
):  # fmt: skip
    """Filter tiles: 16 columns each, transformed along them and back, to the planes of another grid.

    taken, put: of which the ``first`` to ``last`` are done: the tile of the source and that of the target; height: of
    all planes together; keep: leave the filtered spectrum in the tile of the source; joins: of a source of one plane,
    the tile of ``kept`` whose spectrum is added to that of the source before the filter, or -1.
    """
    size, radices, factors, weights = axis
    planes, target_planes = _planes(weights, size), _planes(target_axis[3], size)
    x, y, total = _lines(size), _lines(size), _lines(size if planes * target_planes > 1 else 0)
    count, radix = len(transfer) // (size * SAMPLE), radices[-1]
    hop = size // radix
    for k in range(first, last):
        lines = source[taken[k] * tile * SAMPLE : (taken[k] + 1) * tile * SAMPLE]
        lines[height * SAMPLE : (height + 1) * SAMPLE] = 0
        at = k % count * size
        field, other = _begin(lines, 0, planes, height, x, y, size, radices, factors)
        spectrum = lines if keep else total if planes * target_planes > 1 else field
        if planes > 1:
            _finish(field, total, 0, 1, size, size, radices, factors)
            for plane in range(1, planes):
                field, other = _begin(lines, plane, planes, height, x, y, size, radices, factors)
                _add(field, total, plane, size, radices, weights)
            for q in range(size):
                filtered_sample(total, spectrum, q, transfer, at, sign)
        elif joins[k] < 0:
            for q in range(hop):
                filtered_butterfly(radix, field, q, hop, size, spectrum, q, hop, size, transfer, at, sign)
        else:
            begin = joins[k] * kept_tile
            for q in range(hop):
                joining_butterfly(radix, field, q, hop, size, spectrum, q, hop, size, transfer, at, sign, kept, begin)
        lines = target[put[k] * target_tile * SAMPLE : (put[k] + 1) * target_tile * SAMPLE]
        for plane in range(target_planes):
            shifted = _weighted(spectrum, field, plane, size, target_axis[3])
            result, _ = _begin(shifted, 0, 1, size, other, field, size, radices, factors)
            _finish(result, lines, plane, target_planes, target_height, size, radices, factors)


@njit(f"void(f4[::1], f4[::1], {SHAPE}, i8[::1], i8, i8, f4[::1], i8, i8[::1], {AXIS})", **OPTIONS)
def rows_back(fields, light, shape, blocks, first, last, tiles, tile, starts, axis):
    """The way back of ``rows_forward``: of the tiles, whose real and imaginary parts are exchanged.

    light: if it is not empty, it takes the squared moduli, in the place of ``fields``.
    """
    planes, height, width = shape
    size, radices, factors, weights = axis
    each, count, rest = -(-height // LANES), len(starts), width // LANES * LANES
    all_planes, gaps = _planes(weights, size), _gaps(starts, size)
    step = all_planes // planes
    spectrum, x = _lines(size), _lines(size)
    y = spectrum if all_planes == 1 else _lines(size)
    line = _lines(width if step > 1 else 0)
    for block in blocks[first:last]:
        across, row = block // each, block % each * LANES
        rows = min(LANES, height - row)
        if gaps:
            spectrum[:] = 0
        place = across // planes * count * tile + row * planes + across % planes
        for k in range(count):
            crossed(tiles, place + k * tile, planes, spectrum, starts[k], 1)
        for plane in range(planes):
            for within in range(step):
                shifted = _weighted(spectrum, y, plane + within, size, weights)
                field, _ = _begin(shifted, 0, 1, size, x, y, size, radices, factors)
                if step == 1:
                    line = field
                _finish(field, line, within, step, width if step > 1 else size, size, radices, factors)
            begin = ((across * planes + plane) * height + row) * width
            if len(light):
                for column in range(0, rest, LANES):
                    squared(line, column, light, begin + column, width, rows)
                for column in range(rest, width):
                    for lane in range(rows):
                        imaginary, real = line[column * SAMPLE + lane], line[column * SAMPLE + LANES + lane]
                        light[begin + lane * width + column] = real * real + imaginary * imaginary
            else:
                for column in range(0, rest, LANES):
                    joined(line, column, 1, fields, 2 * (begin + column), 2 * width, rows)
                for column in range(rest, width):
                    for lane in range(rows):
                        for part in range(2):
                            value = line[column * SAMPLE + (1 - part) * LANES + lane]
                            fields[2 * (begin + lane * width + column) + part] = value


@njit(
    f"void(f4[::1], i8, i8[::1], f4[::1], f4, i8[::1], i8, i8, f4[::1], i8, i8[::1], i8, {AXIS})",
    **OPTIONS,
)
def rows_past(source, tile, starts, change, sign, blocks, first, last, target, target_tile, target_starts, width, axis):
    """Blocks of 16 rows of one plane: back from tiles as by ``rows_back``, times what changes them, and to other tiles
    as by ``rows_forward``.

    change: complex factors ``(blocks, width)`` in samples of sixteen rows, of which ``sign`` multiplies the imaginary
    parts.
    """
    size, radices, factors, _ = axis
    x, y, gaps = _lines(size), _lines(size), _gaps(starts, size)
    for k in range(first, last):
        row = blocks[k] * LANES
        if gaps:
            x[:] = 0
        for n in range(len(starts)):
            crossed(source, row + n * tile, 1, x, starts[n], 1)
        field, other = _begin(x, 0, 1, size, y, x, size, radices, factors)
        _finish(field, field, 0, 1, size, size, radices, factors)
        for c in range(width):  # the field is the one with its parts exchanged: that asks for the conjugate
            filtered_sample(field, field, c, change, k * width, -sign)
        field[width * SAMPLE : (width + 1) * SAMPLE] = 0
        spectrum, _ = _begin(field, 0, 1, width, other, field, size, radices, factors)
        _finish(spectrum, spectrum, 0, 1, size, size, radices, factors)
        for n in range(len(target_starts)):
            crossed(spectrum, target_starts[n], 1, target, row + n * target_tile, 1)
