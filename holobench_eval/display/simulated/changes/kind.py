"""What a kind of change is: which parameters of a profile differ, and which values it takes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from ..profile import Profile

Value = float | str
"""How far a condition goes: a number, or the name of one of several."""


@dataclass(frozen=True)
class Kind:
    """A kind of change.

    words: what changes; unit: of the values, empty for a factor or a name; stages: the parameters of ``Profile`` that
    may differ; apply: the profile after a change; model: what is assumed, for reports; nominal: the value that changes
    nothing (None: values are names, or draws, and there is none); low, high: what a number may be; moves: whether the
    camera's view moves, so that it is registered anew (else it stays as it was before the change); counted: whether
    values are whole numbers from 1 that name one of many; read: the one form of a name, UserError for one without a
    meaning; names: what a name may be, in words.
    """

    words: str
    unit: str
    stages: tuple[str, ...]
    apply: Callable[[Profile, Any], Profile]
    model: str
    nominal: float | None = 0.0
    low: float = -math.inf
    high: float = math.inf
    moves: bool = False
    counted: bool = False
    read: Callable[[str], str] = str
    names: str = "names"

    @property
    def numeric(self) -> bool:
        """Whether values are numbers on an axis."""
        return self.nominal is not None


def within(profile: Profile, stage: str, **values: Any) -> Profile:
    """The profile with other values of a stage, by its key in a profile, or of its panel."""
    return replace(profile, **{stage: replace(getattr(profile, stage), **values)})


def added(stage: str, key: str, amount: Callable[[float], float] = float) -> Callable[[Profile, float], Profile]:
    """A change that adds an amount, given by its number, to a value of a stage."""
    return lambda profile, number: within(
        profile, stage, **{key: getattr(getattr(profile, stage), key) + amount(number)}
    )
