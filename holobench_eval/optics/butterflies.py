"""Instructions of the compiled kernel: butterflies of sixteen lines at once, and the transposition of blocks of lines.

A vector of the processor holds the same sample of sixteen neighbouring lines, its real and its imaginary parts apart,
so that any transform is one of vectors. What is written here becomes part of the functions in ``fused``. Numba looks
at the date of their file alone: after a change here, that one has to be saved, too.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from .sizes import LANES, RADICES

Vector = Any  # of LANES values, in the compiler's terms
Complex = tuple[Vector, Vector]

SAMPLE = 2 * LANES  # floats of a sample of sixteen lines: its real parts, then its imaginary ones


class _Transform:
    """Writes the Fourier transform of a few complex vectors as instructions, without loops."""

    def __init__(self, builder: Any) -> None:
        self.builder = builder

    def transform(self, values: Sequence[Complex]) -> list[Complex]:
        """By the first of the factors 4, 5, 3, 2 of their number (Cooley and Tukey)."""
        count = len(values)
        if count in (1, 2, 4):
            return self._of_signs(values)
        if count in (3, 5):
            return self._of_prime(values)
        factor = next(factor for factor in (4, 5, 3, 2) if count % factor == 0)
        others = count // factor
        parts = [self.transform(values[first::others]) for first in range(others)]
        turned = [[self._turned(part[k], first * k, count) for first, part in enumerate(parts)] for k in range(factor)]
        rows = [self.transform(row) for row in turned]
        return [rows[k % factor][k // factor] for k in range(count)]

    def times(self, a: Complex, b: Complex) -> Complex:
        """The product of complex vectors."""
        return (
            self._sub(self._mul(a[0], b[0]), self._mul(a[1], b[1])),
            self._add(self._mul(a[0], b[1]), self._mul(a[1], b[0])),
        )

    def modulus(self, a: Complex) -> Vector:
        """The squared modulus of a complex vector."""
        return self._add(self._mul(a[0], a[0]), self._mul(a[1], a[1]))

    def _of_signs(self, values: Sequence[Complex]) -> list[Complex]:
        if len(values) == 1:
            return list(values)
        if len(values) == 2:
            return [self.plus(*values), self._minus(*values)]
        a, b, c, d = values
        even, other, odd, rest = self.plus(a, c), self._minus(a, c), self.plus(b, d), self._minus(b, d)
        return [self.plus(even, odd), self._minus_i(other, rest), self._minus(even, odd), self._plus_i(other, rest)]

    def _of_prime(self, values: Sequence[Complex]) -> list[Complex]:
        first, count = values[0], len(values)
        pairs = [(values[k], values[count - k]) for k in range(1, count // 2 + 1)]
        sums, differences = [self.plus(*pair) for pair in pairs], [self._minus(*pair) for pair in pairs]
        result = [first] * count
        for value in sums:
            result[0] = self.plus(result[0], value)
        for j in range(1, count // 2 + 1):
            angles = [2 * math.pi * j * k / count for k in range(1, count // 2 + 1)]
            even, odd = first, self._scaled(differences[0], math.sin(angles[0]))
            for angle, value in zip(angles, sums, strict=True):
                even = self.plus(even, self._scaled(value, math.cos(angle)))
            for angle, value in zip(angles[1:], differences[1:], strict=True):
                odd = self.plus(odd, self._scaled(value, math.sin(angle)))
            result[j], result[count - j] = self._minus_i(even, odd), self._plus_i(even, odd)
        return result

    def _turned(self, a: Complex, part: int, whole: int) -> Complex:
        """``a exp(-2 pi i part / whole)``; a quarter of a turn costs no product."""
        quarters = 4 * part / whole % 4
        if quarters == 0:
            return a
        if quarters == 1:
            return a[1], self.builder.fneg(a[0])
        if quarters == 2:
            return self.builder.fneg(a[0]), self.builder.fneg(a[1])
        if quarters == 3:
            return self.builder.fneg(a[1]), a[0]
        factor = cmath.exp(-2j * math.pi * part / whole)
        return self.times(a, (_constant(factor.real), _constant(factor.imag)))

    def _add(self, a: Vector, b: Vector) -> Vector:
        return self.builder.fadd(a, b, flags=("contract",))

    def _sub(self, a: Vector, b: Vector) -> Vector:
        return self.builder.fsub(a, b, flags=("contract",))

    def _mul(self, a: Vector, b: Vector) -> Vector:
        return self.builder.fmul(a, b, flags=("contract",))

    def plus(self, a: Complex, b: Complex) -> Complex:
        return self._add(a[0], b[0]), self._add(a[1], b[1])

    def _minus(self, a: Complex, b: Complex) -> Complex:
        return self._sub(a[0], b[0]), self._sub(a[1], b[1])

    def _plus_i(self, a: Complex, b: Complex) -> Complex:
        return self._sub(a[0], b[1]), self._add(a[1], b[0])

    def _minus_i(self, a: Complex, b: Complex) -> Complex:
        return self._add(a[0], b[1]), self._sub(a[1], b[0])

    def _scaled(self, a: Complex, factor: float) -> Complex:
        return self._mul(a[0], _constant(factor)), self._mul(a[1], _constant(factor))


class _Array:
    """Vectors of an array of floats in memory; places are counted in samples of ``unit`` floats."""

    def __init__(self, context: Any, builder: Any, kind: Any, array: Any, unit: int = SAMPLE) -> None:
        self.builder, self.unit = builder, unit
        self.data = context.make_array(kind)(context, builder, array).data

    def address(self, place: Any, offset: int = 0) -> Any:
        """Of a place, and ``offset`` floats."""
        return self.builder.gep(self.data, [self.builder.add(self.builder.mul(place, _int(self.unit)), _int(offset))])

    def load(self, place: Any, offset: int = 0, lanes: int = LANES) -> Vector:
        kind = ir.VectorType(ir.FloatType(), lanes)
        address = self.builder.bitcast(self.address(place, offset), kind.as_pointer())
        return self.builder.load(address, align=4, typ=kind)

    def store(self, value: Vector, place: Any, offset: int = 0) -> None:
        address = self.builder.bitcast(self.address(place, offset), value.type.as_pointer())
        self.builder.store(value, address, align=4)

    def sample(self, place: Any) -> Complex:
        return self.load(place), self.load(place, LANES)

    def store_sample(self, value: Complex, place: Any) -> None:
        self.store(value[0], place)
        self.store(value[1], place, LANES)

    def spread(self, place: Any, offset: int) -> Vector:
        """One float in every lane."""
        return _spread(self.builder, self.builder.load(self.address(place, offset), typ=ir.FloatType()))


def _int(value: int) -> Any:
    return ir.Constant(ir.IntType(64), value)


def _constant(value: float) -> Any:
    return ir.Constant(ir.VectorType(ir.FloatType(), LANES), [float(np.float32(value))] * LANES)


def _order(places: Iterable[int]) -> Any:
    listed = list(places)
    return ir.Constant(ir.VectorType(ir.IntType(32), len(listed)), listed)


def _spread(builder: Any, value: Any) -> Vector:
    undefined = ir.Constant(ir.VectorType(ir.FloatType(), LANES), ir.Undefined)
    first = builder.insert_element(undefined, value, ir.IntType(32)(0))
    return builder.shuffle_vector(first, undefined, _order([0] * LANES))


def _place(builder: Any, begin: Any, stride: Any, count: int, end: Any = None) -> Any:
    """The place ``begin + count stride``, or ``end`` from there on."""
    place = builder.add(begin, builder.mul(stride, _int(count)))
    return place if end is None else builder.select(builder.icmp_signed("<", place, end), place, end)


def _transposed(builder: Any, rows: Sequence[Vector]) -> list[Vector]:
    """Sixteen vectors of sixteen values, transposed: blocks off the diagonal change places, ever larger ones."""
    lines = list(rows)
    for size in (1, 2, 4, 8):
        for row in (row for row in range(LANES) if not row & size):
            pair = lines[row], lines[row + size]
            for place, kept in ((row, 0), (row + size, size)):
                order = ((lane & ~size) + kept + (LANES if lane & size else 0) for lane in range(LANES))
                lines[place] = builder.shuffle_vector(*pair, _order(order))
    return lines


def _store_transposed(builder: Any, lines: Sequence[Sequence[Vector]], target: _Array, start: Any, hop: Any) -> None:
    parts = [_transposed(builder, part) for part in zip(*lines, strict=True)]
    for k, (real, imaginary) in enumerate(zip(*parts, strict=True)):
        target.store_sample((real, imaginary), _place(builder, start, hop, k))


def _instructions(arguments: str, write: Callable[..., None]) -> Any:
    """Signature and body of a compiled function whose instructions ``write`` gives.

    arguments: a letter each; s: array of samples, f: array of floats, i: integer, g: float.
    """
    array = types.Array(types.float32, 1, "C")
    kinds = {"s": array, "f": array, "i": types.intp, "g": types.float32}
    units = {"s": SAMPLE, "f": 1}

    def code(context: Any, builder: Any, _: Any, values: Sequence[Any]) -> None:
        given = [
            _Array(context, builder, array, value, units[letter]) if letter in units else value
            for letter, value in zip(arguments, values, strict=True)
        ]
        write(builder, *given)

    return types.void(*(kinds[letter] for letter in arguments)), code


def _butterfly(
    builder: Any, radix: Any, places: Sequence[Any], finish: Callable[[_Transform, int, Complex], Complex]
) -> None:
    """One butterfly of each radix, of which the processor takes one.

    It reads samples ``begin + k stride`` of the source and writes samples ``start + k hop`` of the target: what
    ``finish`` makes of the k-th result. From ``end`` and ``limit`` on, these two places stand for all others.
    """
    source, begin, stride, end, target, start, hop, limit = places
    writer = _Transform(builder)
    done = builder.append_basic_block("done")
    chosen = builder.switch(radix, done)
    for count in RADICES:
        block = builder.append_basic_block("radix")
        chosen.add_case(_int(count), block)
        builder.position_at_end(block)
        values = [source.sample(_place(builder, begin, stride, k, end)) for k in range(count)]
        for k, value in enumerate(writer.transform(values)):
            target.store_sample(finish(writer, k, value), _place(builder, start, hop, k, limit))
        builder.branch(done)
    builder.position_at_end(done)


def _filtered(writer: _Transform, value: Complex, transfer: _Array, at: Any, sign: Any) -> Complex:
    real, imaginary = transfer.sample(at)
    product = writer.times(value, (real, writer.builder.fmul(imaginary, _spread(writer.builder, sign))))
    return product[1], product[0]


def _weight(builder: Any, weights: _Array, at: Any, place: Any) -> Complex:
    first = builder.add(at, builder.mul(place, _int(2)))
    return weights.spread(first, 0), weights.spread(first, 1)


@intrinsic
def turned_butterfly(
    _: Any, radix: Any, source: Any, begin: Any, stride: Any, end: Any,
    target: Any, start: Any, hop: Any, limit: Any, factors: Any, at: Any,
) -> Any:  # fmt: skip
    """See ``_butterfly``; all results but the first are multiplied by complex factors, the floats from ``at`` on."""

    def write(builder: Any, radix: Any, *given: Any) -> None:
        *places, factors, at = given

        def turned(writer: _Transform, k: int, value: Complex) -> Complex:
            return writer.times(value, (factors.spread(at, 2 * k - 2), factors.spread(at, 2 * k - 1))) if k else value

        _butterfly(builder, radix, places, turned)

    return _instructions("isiiisiiifi", write)


@intrinsic
def filtered_butterfly(
    _: Any, radix: Any, source: Any, begin: Any, stride: Any, end: Any,
    target: Any, start: Any, hop: Any, limit: Any, transfer: Any, at: Any, sign: Any,
) -> Any:  # fmt: skip
    """See ``_butterfly``; results are multiplied by the filter's samples from ``at`` on, the imaginary parts of which
    are multiplied by ``sign``; then real and imaginary parts are exchanged, for the inverse transform."""

    def write(builder: Any, radix: Any, *given: Any) -> None:
        *places, transfer, at, sign = given
        start, hop = builder.add(at, places[5]), places[6]

        def filtered(writer: _Transform, k: int, value: Complex) -> Complex:
            return _filtered(writer, value, transfer, _place(builder, start, hop, k), sign)

        _butterfly(builder, radix, places, filtered)

    return _instructions("isiiisiiisig", write)


@intrinsic
def joining_butterfly(
    _: Any, radix: Any, source: Any, begin: Any, stride: Any, end: Any,
    target: Any, start: Any, hop: Any, limit: Any, transfer: Any, at: Any, sign: Any, kept: Any, first: Any,
) -> Any:  # fmt: skip
    """``filtered_butterfly`` of the results and what another one gave, the samples of ``kept`` from ``first`` on."""

    def write(builder: Any, radix: Any, *given: Any) -> None:
        *places, transfer, at, sign, kept, first = given
        start, hop = places[5], places[6]

        def filtered(writer: _Transform, k: int, value: Complex) -> Complex:
            imaginary, real = kept.sample(_place(builder, builder.add(first, start), hop, k))
            value = writer.plus(value, (real, imaginary))
            return _filtered(writer, value, transfer, _place(builder, builder.add(at, start), hop, k), sign)

        _butterfly(builder, radix, places, filtered)

    return _instructions("isiiisiiisigsi", write)


@intrinsic
def adding_butterfly(
    _: Any, radix: Any, source: Any, begin: Any, stride: Any, end: Any,
    target: Any, start: Any, hop: Any, limit: Any, weights: Any, at: Any,
) -> Any:  # fmt: skip
    """See ``_butterfly``; results are added to the target, times complex weights, the floats from ``at`` on."""

    def write(builder: Any, radix: Any, *given: Any) -> None:
        *places, weights, at = given
        target, start, hop = places[4], places[5], places[6]

        def added(writer: _Transform, k: int, value: Complex) -> Complex:
            place = _place(builder, start, hop, k)
            return writer.plus(target.sample(place), writer.times(value, _weight(builder, weights, at, place)))

        _butterfly(builder, radix, places, added)

    return _instructions("isiiisiiifi", write)


@intrinsic
def filtered_sample(_: Any, source: Any, target: Any, place: Any, transfer: Any, at: Any, sign: Any) -> Any:
    """What ``filtered_butterfly`` does to one sample of a spectrum."""

    def write(builder: Any, source: _Array, target: _Array, place: Any, transfer: _Array, at: Any, sign: Any) -> None:
        product = _filtered(_Transform(builder), source.sample(place), transfer, builder.add(at, place), sign)
        target.store_sample(product, place)

    return _instructions("ssisig", write)


@intrinsic
def weighted_sample(_: Any, source: Any, target: Any, place: Any, weights: Any, at: Any) -> Any:
    """One sample of a spectrum times its complex weight, of the floats from ``at`` on."""

    def write(builder: Any, source: _Array, target: _Array, place: Any, weights: _Array, at: Any) -> None:
        weight = _weight(builder, weights, at, place)
        target.store_sample(_Transform(builder).times(source.sample(place), weight), place)

    return _instructions("ssifi", write)


@intrinsic
def split(_: Any, field: Any, begin: Any, stride: Any, rows: Any, target: Any, start: Any, hop: Any) -> Any:
    """Sixteen values of ``rows`` rows of a complex field, from the float ``begin`` on, to samples ``start + k hop``.

    Lanes without a row repeat the first.
    """

    def write(
        builder: Any, field: _Array, begin: Any, stride: Any, rows: Any, target: _Array, start: Any, hop: Any
    ) -> None:
        lines = []
        for row in range(LANES):
            inside = builder.icmp_signed("<", _int(row), rows)
            line = field.load(builder.select(inside, _place(builder, begin, stride, row), begin), lanes=SAMPLE)
            lines.append([builder.shuffle_vector(line, line, _order(range(part, SAMPLE, 2))) for part in (0, 1)])
        _store_transposed(builder, lines, target, start, hop)

    return _instructions("fiiisii", write)


@intrinsic
def joined(_: Any, source: Any, begin: Any, hop: Any, field: Any, start: Any, stride: Any, rows: Any) -> Any:
    """Samples ``begin + k hop`` to ``rows`` rows of a complex field; real and imaginary parts are exchanged."""

    def write(
        builder: Any, source: _Array, begin: Any, hop: Any, field: _Array, start: Any, stride: Any, rows: Any
    ) -> None:
        samples = [source.sample(_place(builder, begin, hop, k)) for k in range(LANES)]
        imaginary, real = (_transposed(builder, part) for part in zip(*samples, strict=True))
        order = _order(k // 2 + LANES * (k % 2) for k in range(SAMPLE))
        for row in range(LANES):
            with builder.if_then(builder.icmp_signed("<", _int(row), rows)):
                line = builder.shuffle_vector(real[row], imaginary[row], order)
                field.store(line, _place(builder, start, stride, row))

    return _instructions("siifiii", write)


@intrinsic
def squared(_: Any, source: Any, begin: Any, light: Any, start: Any, stride: Any, rows: Any) -> Any:
    """Squared moduli of sixteen samples from ``begin`` on, to ``rows`` rows."""

    def write(builder: Any, source: _Array, begin: Any, light: _Array, start: Any, stride: Any, rows: Any) -> None:
        writer = _Transform(builder)
        samples = [source.sample(_place(builder, begin, _int(1), k)) for k in range(LANES)]
        for row, line in enumerate(_transposed(builder, [writer.modulus(sample) for sample in samples])):
            with builder.if_then(builder.icmp_signed("<", _int(row), rows)):
                light.store(line, _place(builder, start, stride, row))

    return _instructions("sifiii", write)


@intrinsic
def crossed(_: Any, source: Any, begin: Any, stride: Any, target: Any, start: Any, hop: Any) -> Any:
    """Samples ``begin + k stride`` of sixteen lines to samples ``start + k hop`` of the sixteen lines across."""

    def write(builder: Any, source: _Array, begin: Any, stride: Any, target: _Array, start: Any, hop: Any) -> None:
        samples = [source.sample(_place(builder, begin, stride, k)) for k in range(LANES)]
        _store_transposed(builder, samples, target, start, hop)

    return _instructions("siisii", write)
