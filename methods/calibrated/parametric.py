"""Calibration of an interpretable model of the display: what is measured is also a diagnosis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

from annotated_types import Interval

from ...display.api import DisplaySpec
from .approximator import ModelApproximator, Rates
from .diagnosis import Diagnosed
from .display_model import DisplayModel
from .method import Calibrated
from .terms import Haze


@dataclass(frozen=True)
class ParametricModel(Diagnosed, Calibrated):
    """A physical model of the display with named parameters, learned from captures; Wirtinger holography through it."""

    patterns: Annotated[int, Interval(ge=0, le=1000)] = 9  # and three dark ones

    title: ClassVar[str] = "a physical model"
    RATES: ClassVar[Rates] = Rates(model=3e-2)
    version: ClassVar[int] = 4

    def approximator(self, spec: DisplaySpec) -> ModelApproximator:
        """A display that is as the nominal model says, but for a little crosstalk."""
        return ModelApproximator(DisplayModel(spec), None, self.RATES, Haze(spec))
