"""Ideal propagation of a phase into a region, and of a loss there back to the phase."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from ..display.api import Region
from ..optics import Propagator
from ..optics.blocks import in_blocks
from . import kernels
from .common import TINY
from .losses import Loss, intensity_l2
from .rows import compilable, floats, in_rows


class PhasePropagation:
    """``E = P(exp(i phi))`` in a region for a phase ``(B, H, W)`` [rad], and the derivative by ``phi`` of its loss.

    One complex array of the panel's size holds what travels, there and back. ``exp(i phi)`` is formed twice: that takes
    no longer than to read it from memory. Raises ValueError for a phase of another size than the propagator's.
    """

    def __init__(self, model: Propagator, region: Region, phase: Tensor) -> None:
        if tuple(phase.shape[-2:]) != model.shape:
            raise ValueError(f"phase is {tuple(phase.shape[-2:])}, the propagator was made for {model.shape}")
        self._model, self._region, self._phase = model, region, phase
        light = torch.empty(phase.shape, dtype=model.dtype, device=phase.device)
        in_rows(kernels.unit_rows, _unit_field, light, phase)
        self._image = model.carried(light, spent=True)

    def weigh(self, loss: Loss, target: Tensor) -> Tensor:
        """The loss L ``(B,)`` of ``I = |E|^2`` in the region; ``2 dL/dI E`` takes the place of the image.

        dL/dI is left to autograd, but that of least squares is written out.
        """
        light = self._region.crop(self._image)
        if loss is intensity_l2 and light.shape == target.shape and compilable(self._image, target):
            return _least_squares(self._image, self._region, target)
        intensity = torch.square(light.real).addcmul_(light.imag, light.imag).requires_grad_()
        value = loss(intensity, target)
        (slope,) = torch.autograd.grad(2 * value.sum(), intensity)
        light.mul_(slope)
        self._region.clear_around(self._image)
        return value.detach()

    def phase_gradient(self) -> Tensor:
        """``Re(-i exp(-i phi) P*(image))``, ``(B, H, W)``, of what is at the image by now; only once."""
        returned = self._model.carried(self._image, back=True, spent=True)
        gradient = torch.empty(returned.shape, dtype=self._phase.dtype, device=returned.device)
        in_rows(kernels.gradient_rows, _gradient, returned, self._phase, gradient)
        return gradient


def _least_squares(image: Tensor, region: Region, target: Tensor) -> Tensor:
    """``intensity_l2`` of ``|image|^2`` in the region, and what ``weigh`` does, compiled."""
    light, wanted, corner = floats(image), floats(target), (region.top, region.left)
    products, residuals = np.empty((*target.shape[:2], 3)), np.empty(image.shape[:2])

    def multiply(rows: slice) -> None:
        kernels.product_rows(light, corner, wanted, rows.start, rows.stop, products.reshape(-1, 3))

    in_blocks(multiply, target, products.size // 3, target.numel())
    overlap, size, wanted_size = products.sum(1).T
    scale, wanted_size = overlap / np.maximum(size, TINY), np.maximum(wanted_size, TINY)
    factors = scale.astype(np.float32), (4 * scale / wanted_size).astype(np.float32)

    def turn(rows: slice) -> None:
        kernels.residual_rows(light, corner, wanted, *factors, rows.start, rows.stop, residuals.reshape(-1))

    in_blocks(turn, image, residuals.size, image.numel())
    return torch.from_numpy(residuals.sum(1) / wanted_size).to(target.dtype)


def _unit_field(field: Tensor, phase: Tensor) -> None:
    """``exp(i phase)`` into an array."""
    torch.complex(phase.cos(), phase.sin(), out=field)


def _gradient(field: Tensor, phase: Tensor, gradient: Tensor) -> None:
    """``Im(exp(-i phase) field)`` into an array."""
    torch.mul(phase.cos(), field.imag, out=gradient).addcmul_(phase.sin(), field.real, value=-1)
