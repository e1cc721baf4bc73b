"""How a phase becomes the levels of a real panel: sign, origin, the level of a full turn, mirrors (``phase:``)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
import torch
from annotated_types import Interval
from numpy.typing import NDArray
from torch import Tensor

Levels = NDArray[np.uint8]


@dataclass(frozen=True)
class Convention:
    """What levels 0 to 255 of a panel mean, and which way up it is.

    The methods' convention is ``exp(+i phase)`` with light travelling as ``exp(+i k z)``; row 0 is the top of the
    picture and column 0 its left, seen from where the camera stands. sign: -1 for a panel whose phase grows as its
    level falls (or a path with the other sign); origin: phase [rad] of level 0; two_pi_level: the level, counted from
    0 and possibly beyond the last, that lags a full turn behind level 0; flip_horizontal, flip_vertical: the picture
    is sent to the panel mirrored.
    """

    sign: Literal[1, -1] = 1
    origin: float = 0.0
    two_pi_level: Annotated[float, Interval(gt=1, le=4096)] = 256.0
    flip_horizontal: bool = False
    flip_vertical: bool = False

    def levels(self, phase: Tensor) -> Levels:
        """The uint8 levels ``(..., H, W)`` of a phase [rad].

        With ``two_pi_level`` beyond 256 the panel cannot reach a full turn; phases beyond its reach go to the nearest
        end of it.
        """
        turns = (self.sign * (phase.detach().cpu().double().numpy() - self.origin) / math.tau) % 1.0
        steps = np.round(turns * self.two_pi_level)
        reach = min(self.two_pi_level, 256)
        steps = np.where(steps >= self.two_pi_level, steps - self.two_pi_level, steps)
        beyond = steps > reach - 1 if self.two_pi_level > 256 else np.zeros_like(steps, dtype=bool)
        nearest = np.where(steps - 255 > self.two_pi_level - steps, 0, 255)
        levels = np.where(beyond, nearest, steps.clip(0, 255)).astype(np.uint8)
        return np.ascontiguousarray(self._flipped(levels))

    def phase(self, levels: Levels) -> Tensor:
        """The phase ``(..., H, W)`` [rad] float32 that levels stand for, in the methods' convention."""
        turns = self._flipped(levels).astype(np.float32) / np.float32(self.two_pi_level)
        phase = self.sign * turns * np.float32(math.tau) + np.float32(self.origin)
        return torch.from_numpy(np.ascontiguousarray(phase))

    def _flipped(self, levels: Levels) -> Levels:
        if self.flip_horizontal:
            levels = levels[..., ::-1]
        return levels[..., ::-1, :] if self.flip_vertical else levels
