"""How a phase becomes the levels of a real panel and back: sign, origin, full turn, correction map, mirrors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Literal

import numpy as np
import torch
from annotated_types import MaxLen, MinLen
from numpy.typing import NDArray
from pydantic import AfterValidator, WithJsonSchema
from torch import Tensor

FEWEST, MOST = 8, 65536  # levels to a turn: below are strokes in radians or in pi


def _turn(level: float) -> float:
    if FEWEST <= level <= MOST:
        return level
    raise ValueError(
        f"{level:g} is no level of a full turn; expected {FEWEST} to {MOST} (of a panel that lags 2.1 pi at level 255: "
        "255 * 2 / 2.1 = 243)"
    )


Levels = NDArray[np.uint8]
Level = Annotated[float, AfterValidator(_turn), WithJsonSchema({"type": "number", "minimum": FEWEST, "maximum": MOST})]
FullTurn = Level | Annotated[tuple[Level, ...], MinLen(1), MaxLen(3)]
"""The level that lags a full turn behind level 0: one for all colours, or one for each."""

LAST = 255  # level of a panel


@dataclass(frozen=True)
class Correction:
    """A map that levens the panel, as its maker gives it: what is added to every hologram, modulo a turn.

    file: picture of levels, of the panel's rows and columns as they are sent to it, one plane for all colours or one
    for each; two_pi_level: the level of the map that is a full turn, one for all colours or one for each.
    """

    file: Annotated[str, MinLen(1)]
    two_pi_level: FullTurn = 256.0


@dataclass(frozen=True)
class Convention:
    """What levels 0 to 255 of a panel mean, and which way up it is.

    The methods' convention is ``exp(+i phase)`` with light travelling as ``exp(+i k z)``; row 0 is the top of the
    picture and column 0 its left, seen from where the camera stands. sign: -1 for a panel whose phase grows as its
    level falls (or a path with the other sign); origin: phase [rad] of level 0; two_pi_level: the level, counted from
    0 and possibly beyond the last, that lags a full turn behind level 0, one for all colours or one for each;
    correction: map that is added to what is sent to the panel; flip_horizontal, flip_vertical: the picture is sent to
    the panel mirrored; turns: that the correction adds, ``(H, W)`` or ``(C, H, W)``.
    """

    sign: Literal[1, -1] = 1
    origin: float = 0.0
    two_pi_level: FullTurn = 256.0
    correction: Correction | None = None
    flip_horizontal: bool = False
    flip_vertical: bool = False
    turns: Any = field(default=0.0, metadata={"key": False}, repr=False, compare=False)

    def of(self, channel: int) -> Convention:
        """The convention of a colour alone."""
        own = self.two_pi_level[channel] if isinstance(self.two_pi_level, tuple) else self.two_pi_level
        return replace(self, two_pi_level=own, turns=self.turns[channel] if np.ndim(self.turns) == 3 else self.turns)

    def levels(self, phase: Tensor) -> Levels:
        """The uint8 levels of a phase [rad], ``(C, H, W)``, or ``(H, W)`` where colours do not differ.

        With ``two_pi_level`` beyond 256 the panel cannot reach a full turn; phases beyond its reach go to the nearest
        end of it.
        """
        turns = self.sign * (phase.detach().cpu().double().numpy() - self.origin) / math.tau
        full = per_colour(self.two_pi_level)
        steps = np.round((self._flipped(turns) + self.turns) % 1.0 * full)
        steps = np.where(steps >= full, steps - full, steps)
        nearest = np.where(steps - LAST > full - steps, 0, LAST)
        return np.ascontiguousarray(np.where(steps > LAST, nearest, steps).astype(np.uint8))

    def phase(self, levels: NDArray[Any]) -> Tensor:
        """The phase [rad] in float64 that levels of any type stand for, in the methods' convention; see ``levels``."""
        radians = levels.astype(np.float64) * (math.tau / per_colour(self.two_pi_level)) - math.tau * self.turns
        return torch.from_numpy(np.ascontiguousarray(self.sign * self._flipped(radians) + self.origin))

    @property
    def out_of_reach(self) -> str:
        """One line where the panel's last level is short of a full turn; empty where it is not."""
        full = np.atleast_1d(self.two_pi_level)
        if full.max() <= LAST + 1:
            return ""
        shares = ", ".join(f"{max(0.0, 1 - (LAST + 0.5) / level):.0%}" for level in full)
        return (
            f"phase.two_pi_level: level {LAST} is the last; {shares} of a turn is shown as the nearer end of the range"
        )

    def _flipped(self, values: NDArray[Any]) -> NDArray[Any]:
        if self.flip_horizontal:
            values = values[..., ::-1]
        return values[..., ::-1, :] if self.flip_vertical else values


def per_colour(level: float | Sequence[float]) -> NDArray[np.float64]:
    """Levels that broadcast to ``(C, H, W)``."""
    values = np.asarray(level, dtype=np.float64)
    return values[:, None, None] if values.ndim else values
