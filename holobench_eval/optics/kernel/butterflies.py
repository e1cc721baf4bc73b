"""Instructions of the compiled kernel: butterflies of sixteen lines at once, any transform being one of vectors.

What is written here becomes part of the functions in ``fused``. Numba looks
at the date of their file alone: after a change here, that one has to be saved, too.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Sequence
from typing import Any

from numba.extending import intrinsic

from .lanes import Array, Complex, Vector, constant, instructions, integer, place_of, spread
from .sizes import RADICES


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
        return self.times(a, (constant(factor.real), constant(factor.imag)))

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
        return self._mul(a[0], constant(factor)), self._mul(a[1], constant(factor))


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
        chosen.add_case(integer(count), block)
        builder.position_at_end(block)
        values = [source.sample(place_of(builder, begin, stride, k, end)) for k in range(count)]
        for k, value in enumerate(writer.transform(values)):
            target.store_sample(finish(writer, k, value), place_of(builder, start, hop, k, limit))
        builder.branch(done)
    builder.position_at_end(done)


def _filtered(writer: _Transform, value: Complex, transfer: Array, at: Any, sign: Any) -> Complex:
    real, imaginary = transfer.sample(at)
    product = writer.times(value, (real, writer.builder.fmul(imaginary, spread(writer.builder, sign))))
    return product[1], product[0]


def _weight(builder: Any, weights: Array, at: Any, place: Any) -> Complex:
    first = builder.add(at, builder.mul(place, integer(2)))
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

    return instructions("isiiisiiifi", write)


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
            return _filtered(writer, value, transfer, place_of(builder, start, hop, k), sign)

        _butterfly(builder, radix, places, filtered)

    return instructions("isiiisiiisig", write)


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
            imaginary, real = kept.sample(place_of(builder, builder.add(first, start), hop, k))
            value = writer.plus(value, (real, imaginary))
            return _filtered(writer, value, transfer, place_of(builder, builder.add(at, start), hop, k), sign)

        _butterfly(builder, radix, places, filtered)

    return instructions("isiiisiiisigsi", write)


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
            place = place_of(builder, start, hop, k)
            return writer.plus(target.sample(place), writer.times(value, _weight(builder, weights, at, place)))

        _butterfly(builder, radix, places, added)

    return instructions("isiiisiiifi", write)


@intrinsic
def filtered_sample(_: Any, source: Any, target: Any, place: Any, transfer: Any, at: Any, sign: Any) -> Any:
    """What ``filtered_butterfly`` does to one sample of a spectrum."""

    def write(builder: Any, source: Array, target: Array, place: Any, transfer: Array, at: Any, sign: Any) -> None:
        product = _filtered(_Transform(builder), source.sample(place), transfer, builder.add(at, place), sign)
        target.store_sample(product, place)

    return instructions("ssisig", write)


@intrinsic
def weighted_sample(_: Any, source: Any, target: Any, place: Any, weights: Any, at: Any) -> Any:
    """One sample of a spectrum times its complex weight, of the floats from ``at`` on."""

    def write(builder: Any, source: Array, target: Array, place: Any, weights: Array, at: Any) -> None:
        weight = _weight(builder, weights, at, place)
        target.store_sample(_Transform(builder).times(source.sample(place), weight), place)

    return instructions("ssifi", write)
