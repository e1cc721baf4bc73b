"""Vectors of sixteen lines, and functions made of instructions on them: what the files of the compiled kernel share.

A vector of the processor holds the same sample of sixteen neighbouring lines, its real and its imaginary parts apart.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types

from .sizes import LANES

Vector = Any  # of LANES values, in the compiler's terms
Complex = tuple[Vector, Vector]

SAMPLE = 2 * LANES  # floats of a sample of sixteen lines: its real parts, then its imaginary ones


class Array:
    """Vectors of an array of floats in memory; places are counted in samples of ``unit`` floats."""

    def __init__(self, context: Any, builder: Any, kind: Any, array: Any, unit: int = SAMPLE) -> None:
        self.builder, self.unit = builder, unit
        self.data = context.make_array(kind)(context, builder, array).data

    def address(self, place: Any, offset: int = 0) -> Any:
        """Of a place, and ``offset`` floats."""
        first = self.builder.mul(place, integer(self.unit))
        return self.builder.gep(self.data, [self.builder.add(first, integer(offset))])

    def load(self, place: Any, offset: int = 0, lanes: int = LANES) -> Vector:
        """So many floats from there on."""
        kind = ir.VectorType(ir.FloatType(), lanes)
        address = self.builder.bitcast(self.address(place, offset), kind.as_pointer())
        return self.builder.load(address, align=4, typ=kind)

    def store(self, value: Vector, place: Any, offset: int = 0) -> None:
        """Write a vector there."""
        address = self.builder.bitcast(self.address(place, offset), value.type.as_pointer())
        self.builder.store(value, address, align=4)

    def sample(self, place: Any) -> Complex:
        """Read a sample of sixteen lines."""
        return self.load(place), self.load(place, LANES)

    def store_sample(self, value: Complex, place: Any) -> None:
        """Write a sample of sixteen lines."""
        self.store(value[0], place)
        self.store(value[1], place, LANES)

    def spread(self, place: Any, offset: int) -> Vector:
        """One float in every lane."""
        return spread(self.builder, self.builder.load(self.address(place, offset), typ=ir.FloatType()))


def integer(value: int) -> Any:
    """A constant."""
    return ir.Constant(ir.IntType(64), value)


def constant(value: float) -> Any:
    """A vector of one constant."""
    return ir.Constant(ir.VectorType(ir.FloatType(), LANES), [float(np.float32(value))] * LANES)


def order_of(places: Iterable[int]) -> Any:
    """The mask of a shuffle: the places of what it takes."""
    listed = list(places)
    return ir.Constant(ir.VectorType(ir.IntType(32), len(listed)), listed)


def spread(builder: Any, value: Any) -> Vector:
    """One value in every lane."""
    undefined = ir.Constant(ir.VectorType(ir.FloatType(), LANES), ir.Undefined)
    first = builder.insert_element(undefined, value, ir.IntType(32)(0))
    return builder.shuffle_vector(first, undefined, order_of([0] * LANES))


def place_of(builder: Any, begin: Any, stride: Any, count: int, end: Any = None) -> Any:
    """The place ``begin + count stride``, or ``end`` from there on."""
    place = builder.add(begin, builder.mul(stride, integer(count)))
    return place if end is None else builder.select(builder.icmp_signed("<", place, end), place, end)


def instructions(arguments: str, write: Callable[..., None]) -> Any:
    """Signature and body of a compiled function whose instructions ``write`` gives.

    arguments: a letter each; s: array of samples, f: array of floats, i: integer, g: float.
    """
    array = types.Array(types.float32, 1, "C")
    kinds = {"s": array, "f": array, "i": types.intp, "g": types.float32}
    units = {"s": SAMPLE, "f": 1}

    def code(context: Any, builder: Any, _: Any, values: Sequence[Any]) -> None:
        given = [
            Array(context, builder, array, value, units[letter]) if letter in units else value
            for letter, value in zip(arguments, values, strict=True)
        ]
        write(builder, *given)

    return types.void(*(kinds[letter] for letter in arguments)), code
