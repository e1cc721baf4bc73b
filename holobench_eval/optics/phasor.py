"""From a phase to a field and from a field to its intensity, with gradients written out for speed."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable


def phasor(amplitude: Tensor, phase: Tensor) -> Tensor:
    """``amplitude * exp(i phase)``, as ``torch.polar`` but several times as fast on a CPU.

    Parameters
    ----------
    amplitude
        Real, broadcast to the shape of the phase; it gets no gradient.
    phase
        Any shape [rad]; differentiable once.

    Returns
    -------
    Tensor
        The shape of the phase, complex.

    Examples
    --------
    >>> phasor(torch.tensor(2.0), torch.tensor([0.0, torch.pi / 2])).abs()
    tensor([2., 2.])
    """
    field: Tensor = _Phasor.apply(amplitude.detach(), phase)  # type: ignore[no-untyped-call]
    return field


def mean_phasor(phase: Tensor, dim: int) -> Tensor:
    """The mean of ``exp(i phase)`` along a dimension, of which no complex array of the phase's size is made.

    Parameters
    ----------
    phase
        Any shape [rad]; differentiable once.
    dim
        The dimension that the result lacks.

    Examples
    --------
    >>> mean_phasor(torch.tensor([0.0, torch.pi]), 0).abs() < 1e-6
    tensor(True)
    """
    field: Tensor = _MeanPhasor.apply(phase, dim)  # type: ignore[no-untyped-call]
    return field


def squared_modulus(field: Tensor) -> Tensor:
    """``|field|^2`` of a complex field; differentiable once."""
    intensity: Tensor = _SquaredModulus.apply(field)  # type: ignore[no-untyped-call]
    return intensity


class _Phasor(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, amplitude: Tensor, phase: Tensor) -> Tensor:
        field = torch.complex(phase.cos().mul_(amplitude), phase.sin().mul_(amplitude))
        ctx.save_for_backward(field)
        return field

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> tuple[None, Tensor]:
        (field,) = ctx.saved_tensors
        return None, (grad.imag * field.real).sub_(grad.real * field.imag)


class _MeanPhasor(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, phase: Tensor, dim: int) -> Tensor:
        cosine, sine = phase.cos(), phase.sin()
        ctx.dim = dim
        ctx.save_for_backward(cosine, sine)
        return torch.complex(cosine.mean(dim), sine.mean(dim))

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor, None]:
        cosine, sine = ctx.saved_tensors
        real, imaginary = ((part / cosine.shape[ctx.dim]).unsqueeze(ctx.dim) for part in (grad.real, grad.imag))
        return (cosine * imaginary).sub_(sine * real), None


class _SquaredModulus(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, field: Tensor) -> Tensor:
        ctx.save_for_backward(field)
        return field.real.square() + field.imag.square()

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> Tensor:
        (field,) = ctx.saved_tensors
        return field * (2 * grad)
