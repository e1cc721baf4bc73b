"""Calibration of an interpretable model of the display: what is measured is also a diagnosis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ...display.api import DisplaySpec
from .approximator import ModelApproximator, Rates
from .diagnosis import Diagnosed
from .display_model import DisplayModel
from .method import Calibrated


@dataclass(frozen=True)
class ParametricModel(Diagnosed, Calibrated):
    """A physical model of the display with named parameters, learned from captures; Wirtinger holography through it."""

    RATES: ClassVar[Rates] = Rates(model=3e-2)

    def approximator(self, spec: DisplaySpec) -> ModelApproximator:
        """A display that is as the nominal model says, but for a little crosstalk."""
        return ModelApproximator(DisplayModel(spec), None, self.RATES)
