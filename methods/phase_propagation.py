"""Ideal propagation of a phase into a region, and of a slope there back to the phase, in one array."""

from __future__ import annotations

import torch
from torch import Tensor

from ..display.api import Region
from ..optics import AngularSpectrum
from ..optics.convolution import convolve


class PhasePropagation:
    """``E = P(exp(i phi))`` in a region for a phase ``(B, H, W)`` [rad], and the derivative by ``phi`` for a slope.

    A new array costs as much as a product, so the field lies in an array that is padded from the start, where it has to
    be padded at all, and what is sent back takes the place of the image. Raises ValueError for a phase of another size
    than the propagator's.
    """

    def __init__(self, model: AngularSpectrum, region: Region, phase: Tensor) -> None:
        height, width = model.shape
        if tuple(phase.shape[-2:]) != (height, width):
            raise ValueError(f"phase is {tuple(phase.shape[-2:])}, the propagator was made for {model.shape}")
        self._model, self._region = model, region
        padded = model.blank(*phase.shape[:-2])
        self._at_panel = padded[..., :height, :width]
        torch.complex(phase.cos(), phase.sin(), out=self._at_panel)
        self._image = convolve(padded, model.transfer)
        self.field = region.crop(self._image)

    def intensity(self) -> Tensor:
        """``|E|^2`` in the region, ``(B, h, w)``."""
        return torch.square(self.field.real).addcmul_(self.field.imag, self.field.imag)

    def phase_gradient(self) -> Tensor:
        """``Re(-i exp(-i phi) P*(E))``, ``(B, H, W)``, of what ``field`` holds by now; only once."""
        height, width = self._model.shape
        returned = convolve(self._region.clear_around(self._image), self._model.conjugate)[..., :height, :width]
        panel = self._at_panel
        return (panel.real * returned.imag).addcmul_(panel.imag, returned.real, value=-1)
