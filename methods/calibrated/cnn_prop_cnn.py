"""Calibration by networks around the ideal propagation: a CNN at the panel, free space, a CNN at the target.

Choi, Gopakumar, Peng, Kim & Wetzstein, "Neural 3D holography: learning accurate wave propagation models for 3D
holographic virtual and augmented reality displays", ACM Trans. Graph. 40(6), 240 (2021): its model "CNNpropCNN".
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor, nn

from ... import seeds
from ...optics.phasor import squared_modulus
from ..common import safe_amplitude, unit_field
from ..hil.baselines import UNet
from ..hil.loop import Steps
from ..hil.networks import draw_weights
from .approximator import ModelApproximator, Rates, start_at_zero
from .method import Calibrated, Schedule

if TYPE_CHECKING:
    from ...display.contract import DisplaySpec


class TwoNetworks(nn.Module):
    """Phase to intensity; both networks see real and imaginary part of the field of every colour.

    panel: what is added to the field at the panel. target: what is added to the amplitude at the image plane.
    brightness: logarithm of the camera's gain, per colour.
    """

    def __init__(self, spec: DisplaySpec, levels: int, width: int) -> None:
        super().__init__()
        self.spec = spec
        colours = len(spec.wavelengths)
        self.panel = start_at_zero(draw_weights(UNet(2 * colours, 2 * colours, levels, width), None))
        self.target = start_at_zero(draw_weights(UNet(2 * colours, colours, levels, width), None))
        self.brightness = nn.Parameter(torch.zeros(colours))

    def forward(self, phase: Tensor) -> Tensor:
        """Intensity ``(C, h, w)`` in the region for a phase ``(C, H, W)`` [rad]."""
        lit = parts(unit_field(phase))
        real, imaginary = (lit + self.panel(lit[None])[0]).chunk(2)
        panel = torch.complex(real, imaginary)
        propagated = [self.spec.propagator(channel).forward(one) for channel, one in enumerate(panel)]
        field = self.spec.region.crop(torch.stack(propagated))
        amplitude = safe_amplitude(squared_modulus(field)) + self.target(parts(field)[None])[0]
        return amplitude.square() * torch.exp(self.brightness)[:, None, None]


def parts(field: Tensor) -> Tensor:
    """Real and imaginary part of a field ``(C, H, W)`` as ``(2 C, H, W)``."""
    return torch.cat([field.real, field.imag])


@dataclass(frozen=True)
class OneRound(Schedule):
    """All captures before the training, as in the paper."""

    rounds: Annotated[int, Interval(ge=1, le=100)] = 1
    images: Annotated[int, Interval(ge=1)] | None = 48
    steps: Steps = 600


@dataclass(frozen=True)
class CNNPropCNN(Calibrated):
    """Two U-Nets around the ideal propagation, in a size for small panels and a CPU.

    levels, width: halvings of the resolution and features at full resolution of each network; the paper's are larger,
    and it trains one pair for each colour where this one sees all. What the paper's networks put in the place of the
    field, these add to it, and begin with nothing: a few dozen captures cannot teach a network what free space does.
    """

    training: OneRound = OneRound()
    patterns: Annotated[int, Interval(ge=0, le=1000)] = 0
    levels: Annotated[int, Interval(ge=1, le=8)] = 2
    width: Annotated[int, Interval(ge=2, le=256)] = 8

    RATES: ClassVar[Rates] = Rates(model=2e-3)

    def approximator(self, spec: DisplaySpec) -> ModelApproximator:
        """Networks that add nothing."""
        with torch.random.fork_rng(devices=[]):
            torch.set_rng_state(seeds.generator("cnn_prop_cnn", self.seed).get_state())
            return ModelApproximator(TwoNetworks(spec, self.levels, self.width), None, self.RATES)
