"""Ideal propagation of a phase into a region, and of a slope there back to the phase."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from ..display.api import Region
from ..optics import AngularSpectrum
from ..optics.blocks import in_blocks


class PhasePropagation:
    """``E = P(exp(i phi))`` in a region for a phase ``(B, H, W)`` [rad], and the derivative by ``phi`` for a slope.

    What is sent back takes the place of the image. Raises ValueError for a phase of another size than the propagator's.
    """

    def __init__(self, model: AngularSpectrum, region: Region, phase: Tensor) -> None:
        if tuple(phase.shape[-2:]) != model.shape:
            raise ValueError(f"phase is {tuple(phase.shape[-2:])}, the propagator was made for {model.shape}")
        self._transfer, self._region = model.transfer, region
        self._at_panel = torch.empty(phase.shape, dtype=model.transfer.dtype, device=phase.device)
        _in_rows(_unit_field, self._at_panel, phase)
        self._image = self._transfer.convolve(self._at_panel)
        self.field = region.crop(self._image)

    def intensity(self) -> Tensor:
        """``|E|^2`` in the region, ``(B, h, w)``."""
        return torch.square(self.field.real).addcmul_(self.field.imag, self.field.imag)

    def phase_gradient(self) -> Tensor:
        """``Re(-i exp(-i phi) P*(E))``, ``(B, H, W)``, of what ``field`` holds by now; only once."""
        returned = self._transfer.convolve(self._region.clear_around(self._image), conjugated=True)
        gradient = torch.empty_like(returned.real)
        _in_rows(_imaginary_product, gradient, self._at_panel, returned)
        return gradient


def _in_rows(work: Callable[..., object], *arrays: Tensor) -> None:
    """Call ``work`` on blocks of the same rows of arrays ``(..., H, W)``."""
    first = arrays[0]
    in_blocks(lambda rows: work(*(array[..., rows, :] for array in arrays)), first, first.shape[-2], first.numel())


def _unit_field(field: Tensor, phase: Tensor) -> None:
    """``exp(i phase)`` into an array."""
    torch.complex(phase.cos(), phase.sin(), out=field)


def _imaginary_product(product: Tensor, a: Tensor, b: Tensor) -> None:
    """``Im(conj(a) b)`` into an array."""
    torch.mul(a.real, b.imag, out=product).addcmul_(a.imag, b.real, value=-1)
