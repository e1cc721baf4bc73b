"""Ideal propagation of a phase into a region, and of a slope there back to the phase."""

from __future__ import annotations

import torch
from torch import Tensor

from ..display.api import Region
from ..optics import AngularSpectrum


class PhasePropagation:
    """``E = P(exp(i phi))`` in a region for a phase ``(B, H, W)`` [rad], and the derivative by ``phi`` for a slope.

    What is sent back takes the place of the image. Raises ValueError for a phase of another size than the propagator's.
    """

    def __init__(self, model: AngularSpectrum, region: Region, phase: Tensor) -> None:
        if tuple(phase.shape[-2:]) != model.shape:
            raise ValueError(f"phase is {tuple(phase.shape[-2:])}, the propagator was made for {model.shape}")
        self._transfer, self._region = model.transfer, region
        self._at_panel = torch.complex(phase.cos(), phase.sin())
        self._image = self._transfer.convolve(self._at_panel)
        self.field = region.crop(self._image)

    def intensity(self) -> Tensor:
        """``|E|^2`` in the region, ``(B, h, w)``."""
        return torch.square(self.field.real).addcmul_(self.field.imag, self.field.imag)

    def phase_gradient(self) -> Tensor:
        """``Re(-i exp(-i phi) P*(E))``, ``(B, H, W)``, of what ``field`` holds by now; only once."""
        returned = self._transfer.convolve(self._region.clear_around(self._image), conjugated=True)
        panel = self._at_panel
        return (panel.real * returned.imag).addcmul_(panel.imag, returned.real, value=-1)
