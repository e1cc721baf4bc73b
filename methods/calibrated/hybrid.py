"""Calibration of an interpretable model, and of a small network for what that model has no parameter for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor, nn

from ...display.api import DisplaySpec
from ...display.estimates import Estimate
from ...optics.phasor import phasor
from ..learned.weights import seeded
from .approximator import ModelApproximator, Rates
from .diagnosis import Diagnosed
from .display_model import FORM, DisplayModel
from .method import Calibrated
from .networks import ColourByColour
from .terms import Haze


class FinePanel(DisplayModel):
    """``DisplayModel`` with light of its own at every pixel of the panel, where dirt and a rough surface change it.

    fine: logarithm of the amplitude, and phase [rad], ``(2, C, H, W)``, besides the smooth illumination.
    """

    def __init__(self, spec: DisplaySpec) -> None:
        super().__init__(spec)
        self.fine = nn.Parameter(torch.zeros(2, len(spec.wavelengths), *spec.shape))

    def illumination(self) -> Tensor:
        """See the base."""
        amplitude, angle = self.fine
        return super().illumination() * torch.exp(amplitude) * phasor(angle.new_ones(()), angle)


class Residual(nn.Module):
    """Capture so far, intensity, real and imaginary part ``(1, 4 C, h, w)`` to what is added, ``(1, C, h, w)``."""

    def __init__(self, colours: int, width: int) -> None:
        super().__init__()
        self.network = ColourByColour(colours, 4, 1, width)

    def forward(self, seen: Tensor) -> Tensor:
        """See the class."""
        added: Tensor = self.network(seen.view(4, -1, *seen.shape[-2:]).transpose(0, 1))
        return added.transpose(0, 1)


@dataclass(frozen=True)
class HybridModel(Diagnosed, Calibrated):
    """The parametric model, a map of the panel pixel by pixel and a residual network, learned from the same captures.

    Map and network begin with nothing. The other parameters are those of all calibrated methods. SI units throughout.

    Parameters
    ----------
    width : int
        Features of the network.
    """

    patterns: Annotated[int, Interval(ge=0, le=1000)] = 9  # and three dark ones
    width: Annotated[int, Interval(ge=2, le=256)] = 16

    title: ClassVar[str] = "a physical model and a network"
    RATES: ClassVar[Rates] = Rates(model=3e-2, network=1e-3)
    version: ClassVar[int] = 4
    form: ClassVar[frozenset[str]] = FORM | {"fringes", "panel_dust", "roughness"}

    def approximator(self, spec: DisplaySpec) -> ModelApproximator:
        """A display as the nominal model says."""
        with seeded("hybrid_model", self.seed):
            residual = Residual(len(spec.wavelengths), self.width)
        return ModelApproximator(FinePanel(spec), residual, self.RATES, Haze(spec))

    def estimates(self, learned: Mapping[str, Any], spec: DisplaySpec) -> list[Estimate]:
        """Those of the ``DisplayModel``; what map and network took over is not among them."""
        model = {name: value for name, value in learned["model"].items() if name != "fine"}
        return super().estimates({**learned, "model": model}, spec)
