"""Calibration by networks around the ideal propagation: a CNN at the panel, free space, a CNN at the target.

Choi, Gopakumar, Peng, Kim & Wetzstein, "Neural 3D holography: learning accurate wave propagation models for 3D
holographic virtual and augmented reality displays", ACM Trans. Graph. 40(6), 240 (2021): its model "CNNpropCNN".
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor, nn

from ...display.api import DisplaySpec
from ...display.nominal import propagated
from ...optics.phasor import squared_modulus
from ..common import safe_amplitude, unit_field
from ..learned.samples import Steps
from ..learned.weights import seeded
from .approximator import ModelApproximator, Rates
from .method import Calibrated, ShortSchedule
from .networks import ColourByColour


class TwoNetworks(nn.Module):
    """Phase to intensity; both networks see real and imaginary part of the field, of each colour by itself.

    panel: what is added to the field at the panel. target: what is added to the amplitude at the image plane.
    brightness: logarithm of the camera's gain, per colour.
    """

    def __init__(self, spec: DisplaySpec, width: int) -> None:
        super().__init__()
        self.spec = spec
        colours = len(spec.wavelengths)
        self.panel = ColourByColour(colours, 2, 2, width)
        self.target = ColourByColour(colours, 2, 1, width)
        self.brightness = nn.Parameter(torch.zeros(colours))

    def forward(self, phase: Tensor) -> Tensor:
        """Intensity ``(C, h, w)`` in the region for a phase ``(C, H, W)`` [rad]."""
        lit = parts(unit_field(phase))
        real, imaginary = (lit + self.panel(lit)).unbind(1)
        field = self.spec.region.crop(propagated(torch.complex(real, imaginary), self.spec))
        amplitude = safe_amplitude(squared_modulus(field)) + self.target(parts(field))[:, 0]
        return amplitude.square() * torch.exp(self.brightness)[:, None, None]


def parts(field: Tensor) -> Tensor:
    """Real and imaginary part of a field ``(C, H, W)`` as ``(C, 2, H, W)``."""
    return torch.stack([field.real, field.imag], 1)


@dataclass(frozen=True)
class LongerSchedule(ShortSchedule):
    """More steps on more natural holograms than a model with few parameters needs."""

    images: Annotated[int, Interval(ge=1)] | None = 24
    steps: Steps = 400


@dataclass(frozen=True)
class CNNPropCNN(Calibrated):
    """Two networks around the ideal propagation, in a size for small panels and a CPU.

    As in the paper, a pair for each colour. Its networks are U-Nets and give the field itself; here, where a few dozen
    captures have to do, they are three convolutions at full resolution, add to the field, and begin with nothing. The
    other parameters are those of all calibrated methods. SI units throughout.

    Parameters
    ----------
    width : int
        Features of each network.
    """

    training: LongerSchedule = LongerSchedule()
    width: Annotated[int, Interval(ge=2, le=256)] = 16

    title: ClassVar[str] = "networks around the propagation"
    RATES: ClassVar[Rates] = Rates(model=5e-3)

    def approximator(self, spec: DisplaySpec) -> ModelApproximator:
        """Networks that add nothing."""
        with seeded("cnn_prop_cnn", self.seed):
            return ModelApproximator(TwoNetworks(spec, self.width), None, self.RATES)
