"""The floor: what pictures that show nothing of a method's skill score on the same targets."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import torch
from torch import Tensor

from ..core.seeds import generator


def floor_captures(target: Tensor, others: Sequence[Tensor], *names: object) -> dict[str, Callable[[], Tensor]]:
    """What makes the reference captures for a target (C, h, w) in linear light, by row name.

    others: the study's other targets, in cyclic order from the one after this; the first is the wrong target, and
    without any that row is absent. names: what the speckle depends on (for example the target's name), besides the
    shape. Raises ValueError when the targets differ in shape.
    """
    if target.ndim != 3 or any(other.shape != target.shape for other in others):
        raise ValueError("targets must all be (C, h, w) of one shape")

    def speckle() -> Tensor:
        """Fully developed, without any picture: exponential intensity of unit mean, one grain a pixel."""
        uniform = torch.rand(target.shape, generator=generator("floor_speckle", *names), dtype=torch.float64)
        return -torch.log1p(-uniform).to(target)

    captures: dict[str, Callable[[], Tensor]] = {
        # an even gray per channel at the least-squares best level
        "floor_constant": lambda: target.mean(dim=(1, 2), keepdim=True).expand_as(target).clone(),
        "floor_black": lambda: torch.zeros_like(target),
        "floor_speckle": speckle,
        "floor_mirrored": lambda: target.flip(-1),
        "floor_shift_1px": lambda: torch.cat([target[..., :1], target[..., :-1]], dim=-1),
    }
    return captures | ({"floor_wrong_target": others[0].clone} if others else {})
