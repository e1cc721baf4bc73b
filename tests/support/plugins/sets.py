"""Data sets of names alone."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from annotated_types import Interval


@dataclass(frozen=True)
class Images:
    count: Annotated[int, Interval(ge=0)] = 2

    def items(self):
        return [f"image {i}" for i in range(self.count)]


@dataclass(frozen=True)
class Training(Images):
    training: ClassVar[bool] = True
