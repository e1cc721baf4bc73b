"""The parametric model with the spectrum of the source in it (Peng et al. 2021, Sci. Adv. 7, eabg5040)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from ...display.api import DisplaySpec
from ...optics.phasor import squared_modulus
from ..calibrated.approximator import ModelApproximator
from ..calibrated.display_model import DisplayModel
from ..calibrated.parametric import ParametricModel
from ..calibrated.terms import Haze
from .spectral import lines, stroke


class SpectralDisplayModel(DisplayModel):
    """``DisplayModel`` behind a source of several lines, which are nominal and stay as they are."""

    def over_panel(self, phase: Tensor) -> Tensor:
        """Intensity ``(C, H, W)`` in the image plane for a phase ``(C, H, W)`` [rad]."""
        maps = self._maps()
        shown = self._shown(phase, maps)
        intensity = torch.zeros_like(shown)
        for offsets, shares in lines(self.spec):
            pairs = zip(self.spec.wavelengths, offsets, strict=True)
            strokes = shown.new_tensor([stroke(wavelength, offset) for wavelength, offset in pairs])
            field = self._image(shown * strokes[:, None, None], maps, offsets)
            intensity = intensity + shown.new_tensor(shares)[:, None, None] * squared_modulus(field)
        return intensity


@dataclass(frozen=True)
class PartiallyCoherentModel(ParametricModel):
    """A physical model of the display behind the nominal spectrum of its source, learned from captures; descent through
    it."""

    title: ClassVar[str] = "a physical model with the source's spectrum, Peng 2021"
    version: ClassVar[int] = 1

    def approximator(self, spec: DisplaySpec) -> ModelApproximator:
        """A display that is as the nominal model says, but for a little crosstalk."""
        return ModelApproximator(SpectralDisplayModel(spec), None, self.RATES, Haze(spec))
