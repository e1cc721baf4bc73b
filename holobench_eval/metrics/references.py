"""The floor: what pictures that show nothing of a method's skill score on the same targets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import torch
from torch import Tensor

from ..core.seeds import generator


def constant(target: Tensor) -> Tensor:
    """An even gray per channel at the least-squares best level, the target's mean."""
    return target.mean(dim=(1, 2), keepdim=True).expand_as(target).clone()


def black(target: Tensor) -> Tensor:
    """No light at all."""
    return torch.zeros_like(target)


def speckle(target: Tensor, *names: object) -> Tensor:
    """Fully developed speckle without any picture: exponential intensity of unit mean, one grain a pixel.

    names: what the random numbers depend on, besides the shape.
    """
    uniform = torch.rand(target.shape, generator=generator("floor_speckle", *names), dtype=torch.float64)
    return -torch.log1p(-uniform).to(target)


def mirrored(target: Tensor) -> Tensor:
    """The target with left and right exchanged."""
    return target.flip(-1)


def shifted(target: Tensor) -> Tensor:
    """The target one pixel to the right, its first column repeated."""
    return torch.cat([target[..., :1], target[..., :-1]], dim=-1)


def floor_captures(target: Tensor, others: Sequence[Tensor], *names: object) -> dict[str, Callable[[], Tensor]]:
    """What makes the reference captures for a target (C, h, w) in linear light, by row name.

    others: the study's other targets, in cyclic order from the one after this; the first is the wrong target, and
    without any that row is absent. names: what the speckle depends on (for example the target's name).
    Raises ValueError when the targets differ in shape.
    """
    if target.ndim != 3 or any(other.shape != target.shape for other in others):
        raise ValueError("targets must all be (C, h, w) of one shape")
    captures: dict[str, Callable[[], Tensor]] = {
        "floor_constant": partial(constant, target),
        "floor_black": partial(black, target),
        "floor_speckle": partial(speckle, target, *names),
        "floor_mirrored": partial(mirrored, target),
        "floor_shift_1px": partial(shifted, target),
    }
    return captures | ({"floor_wrong_target": others[0].clone} if others else {})
