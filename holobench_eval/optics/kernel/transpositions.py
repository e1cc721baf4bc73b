"""Instructions of the compiled kernel that transpose blocks of sixteen lines.

Numba looks at the date of ``fused`` alone: after a change here, that file has to be saved, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from numba.extending import intrinsic

from .lanes import SAMPLE, Array, Vector, instructions, integer, order_of, place_of
from .sizes import LANES


def _transposed(builder: Any, rows: Sequence[Vector]) -> list[Vector]:
    """Sixteen vectors of sixteen values, transposed: blocks off the diagonal change places, ever larger ones."""
    lines = list(rows)
    for size in (1, 2, 4, 8):
        for row in (row for row in range(LANES) if not row & size):
            pair = lines[row], lines[row + size]
            for place, kept in ((row, 0), (row + size, size)):
                order = ((lane & ~size) + kept + (LANES if lane & size else 0) for lane in range(LANES))
                lines[place] = builder.shuffle_vector(*pair, order_of(order))
    return lines


def _store_transposed(builder: Any, lines: Sequence[Sequence[Vector]], target: Array, start: Any, hop: Any) -> None:
    parts = [_transposed(builder, part) for part in zip(*lines, strict=True)]
    for k, (real, imaginary) in enumerate(zip(*parts, strict=True)):
        target.store_sample((real, imaginary), place_of(builder, start, hop, k))


@intrinsic
def split(_: Any, field: Any, begin: Any, stride: Any, rows: Any, target: Any, start: Any, hop: Any) -> Any:
    """Sixteen values of ``rows`` rows of a complex field, from the float ``begin`` on, to samples ``start + k hop``.

    Lanes without a row repeat the first.
    """

    def write(
        builder: Any, field: Array, begin: Any, stride: Any, rows: Any, target: Array, start: Any, hop: Any
    ) -> None:
        lines = []
        for row in range(LANES):
            inside = builder.icmp_signed("<", integer(row), rows)
            line = field.load(builder.select(inside, place_of(builder, begin, stride, row), begin), lanes=SAMPLE)
            lines.append([builder.shuffle_vector(line, line, order_of(range(part, SAMPLE, 2))) for part in (0, 1)])
        _store_transposed(builder, lines, target, start, hop)

    return instructions("fiiisii", write)


@intrinsic
def joined(_: Any, source: Any, begin: Any, hop: Any, field: Any, start: Any, stride: Any, rows: Any) -> Any:
    """Samples ``begin + k hop`` to ``rows`` rows of a complex field; real and imaginary parts are exchanged."""

    def write(
        builder: Any, source: Array, begin: Any, hop: Any, field: Array, start: Any, stride: Any, rows: Any
    ) -> None:
        samples = [source.sample(place_of(builder, begin, hop, k)) for k in range(LANES)]
        imaginary, real = (_transposed(builder, part) for part in zip(*samples, strict=True))
        order = order_of(k // 2 + LANES * (k % 2) for k in range(SAMPLE))
        for row in range(LANES):
            with builder.if_then(builder.icmp_signed("<", integer(row), rows)):
                line = builder.shuffle_vector(real[row], imaginary[row], order)
                field.store(line, place_of(builder, start, stride, row))

    return instructions("siifiii", write)


@intrinsic
def squared(_: Any, source: Any, begin: Any, light: Any, start: Any, stride: Any, rows: Any) -> Any:
    """Squared moduli of sixteen samples from ``begin`` on, to ``rows`` rows."""

    def write(builder: Any, source: Array, begin: Any, light: Array, start: Any, stride: Any, rows: Any) -> None:
        samples = [source.sample(place_of(builder, begin, integer(1), k)) for k in range(LANES)]
        squares = [[builder.fmul(part, part, flags=("contract",)) for part in sample] for sample in samples]
        moduli = [builder.fadd(*square, flags=("contract",)) for square in squares]
        for row, line in enumerate(_transposed(builder, moduli)):
            with builder.if_then(builder.icmp_signed("<", integer(row), rows)):
                light.store(line, place_of(builder, start, stride, row))

    return instructions("sifiii", write)


@intrinsic
def crossed(_: Any, source: Any, begin: Any, stride: Any, target: Any, start: Any, hop: Any) -> Any:
    """Samples ``begin + k stride`` of sixteen lines to samples ``start + k hop`` of the sixteen lines across."""

    def write(builder: Any, source: Array, begin: Any, stride: Any, target: Array, start: Any, hop: Any) -> None:
        samples = [source.sample(place_of(builder, begin, stride, k)) for k in range(LANES)]
        _store_transposed(builder, samples, target, start, hop)

    return instructions("siisii", write)
