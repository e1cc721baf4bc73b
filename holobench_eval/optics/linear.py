"""Maps whose gradient is written out, where autograd would take longer or more memory: linear ones by their adjoint."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

Map = Callable[[Tensor], Tensor]
Adjoint = Callable[..., Tensor]


def linear(forward: Map, adjoint: Adjoint, values: Tensor, *known: Tensor) -> Tensor:
    """``forward`` of values, whose gradient is ``adjoint`` of that of the result; differentiable once.

    Other maps than linear ones have a derivative at the values, which ``adjoint`` then knows.
    """
    result: Tensor = _Linear.apply(values, forward, adjoint, *known)  # type: ignore[no-untyped-call]
    return result


class _Linear(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, values: Tensor, forward: Map, adjoint: Adjoint, *known: Tensor) -> Tensor:
        ctx.adjoint = adjoint
        ctx.save_for_backward(*known)
        return forward(values)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor | None, ...]:
        known = ctx.saved_tensors
        return ctx.adjoint(grad, *known), None, None, *(None for _ in known)
