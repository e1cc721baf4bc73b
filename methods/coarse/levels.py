"""The levels of a colour of a panel: the nearest to a phase, what light gets from it, and what shows it."""

from __future__ import annotations

import torch
from torch import Tensor

from ...display.api import DisplaySpec
from ...optics.phase import TAU, blaze, wrap


class Levels:
    """The nominal phases of a panel's levels for a colour, on the device of ``like``.

    A display adds its blaze before it chooses a level, and its optics take it off again; so does this.

    Examples
    --------
    >>> from holobench_eval.display.api import Region
    >>> spec = DisplaySpec("binary", (1, 2), 8.2e-6, (532e-9,), 0.1, 1, None, Region(0, 0, 1, 2))
    >>> levels = Levels(spec, 0, torch.zeros(()))
    >>> levels.nearest(torch.tensor([[0.4, 3.0]]))
    tensor([[0, 1]])
    """

    def __init__(self, spec: DisplaySpec, channel: int, like: Tensor) -> None:
        self.phases = wrap(spec.level_phases(channel).to(like))
        self._ramp = blaze(spec.shape, spec.blaze).to(like) if any(spec.blaze) else like.new_zeros(())
        self._sorted, self._order = self.phases.sort()
        following = torch.cat([self._sorted[1:], self._sorted[:1] + TAU])
        self._edges = (self._sorted + following) / 2  # above each level; the last may lie beyond a turn

    def nearest(self, phase: Tensor) -> Tensor:
        """The level ``(..., H, W)`` of the least difference from a phase [rad] around the circle."""
        turned = wrap(phase + self._ramp)
        turned = torch.where(turned < self._edges[-1] - TAU, turned + TAU, turned)
        return self._order[torch.bucketize(turned, self._edges) % len(self._order)]

    def light(self, level: Tensor) -> Tensor:
        """The nominal phase [rad] of light from levels, without the blaze."""
        return self.phases[level] - self._ramp

    def shown_by(self, level: Tensor) -> Tensor:
        """The phase [rad] for which the display shows these levels."""
        return level * (TAU / len(self.phases)) - self._ramp
