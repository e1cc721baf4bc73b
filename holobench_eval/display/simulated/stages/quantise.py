"""Stage 1: the phase is wrapped and rounded to the panel's gray levels (paper Eq. 6)."""

from __future__ import annotations

from torch import Tensor

from ....optics.phase import TAU, gray_level, wrap


def straight_through_level(phase: Tensor, bits: int) -> Tensor:
    """Gray level 0 .. 2^bits - 1 of a phase [rad], as a float; its gradient is that of the unrounded level."""
    level = gray_level(phase.detach(), bits)
    if not phase.requires_grad:
        return level
    smooth = wrap(phase) * (2**bits / TAU)
    return smooth + (level - smooth).detach()
