"""Calibration of an interpretable model, and of a small network for what that model has no parameter for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor, nn

from ... import seeds
from ...optics.phasor import phasor
from ..display_model import DisplayModel
from ..hil.networks import draw_weights
from .approximator import ModelApproximator, Rates, start_at_zero
from .diagnosis import Diagnosed, diagnose
from .method import Calibrated

if TYPE_CHECKING:
    from ...display.contract import DisplaySpec
    from ...display.estimates import Estimate


class FinePanel(DisplayModel):
    """``DisplayModel`` with light of its own at every pixel of the panel, where dirt and a rough surface change it.

    fine: logarithm of the amplitude, and phase [rad], ``(2, C, H, W)``, besides the smooth illumination.
    """

    def __init__(self, spec: DisplaySpec) -> None:
        super().__init__(spec)
        self.fine = nn.Parameter(torch.zeros(2, len(spec.wavelengths), *spec.shape))

    def _illumination(self) -> Tensor:
        amplitude, angle = self.fine
        return super()._illumination() * torch.exp(amplitude) * phasor(angle.new_ones(()), angle)


class Residual(nn.Module):
    """Three convolutions at full resolution, of what is there and where it is.

    Intensity, real and imaginary part ``(1, 3 C, h, w)`` to what is added to the intensity, ``(1, C, h, w)``. The
    position, -1 to 1 on both axes, is given too: a camera's shading depends on it, and convolutions do not know it.
    """

    def __init__(self, colours: int, width: int) -> None:
        super().__init__()
        layers = [nn.Conv2d(3 * colours + 2, width, 3, padding=1), nn.ReLU()]
        layers += [nn.Conv2d(width, width, 3, padding=1), nn.ReLU(), nn.Conv2d(width, colours, 3, padding=1)]
        self.layers = start_at_zero(draw_weights(nn.Sequential(*layers), None))

    def forward(self, seen: Tensor) -> Tensor:
        """See the class."""
        height, width = seen.shape[-2:]
        rows = torch.linspace(-1, 1, height).view(1, 1, -1, 1).expand(1, 1, height, width)
        columns = torch.linspace(-1, 1, width).view(1, 1, 1, -1).expand(1, 1, height, width)
        added: Tensor = self.layers(torch.cat([seen, rows, columns], 1).contiguous(memory_format=torch.channels_last))
        return added


@dataclass(frozen=True)
class HybridModel(Diagnosed, Calibrated):
    """``DisplayModel``, a map of the panel pixel by pixel and a residual network that learn from the same captures.

    Map and network begin with nothing. width: features of the network.
    """

    width: Annotated[int, Interval(ge=2, le=256)] = 16

    RATES: ClassVar[Rates] = Rates(model=3e-2, network=1e-3)

    def approximator(self, spec: DisplaySpec) -> ModelApproximator:
        """A display as the nominal model says."""
        with torch.random.fork_rng(devices=[]):
            torch.set_rng_state(seeds.generator("hybrid_model", self.seed).get_state())
            residual = Residual(len(spec.wavelengths), self.width)
        return ModelApproximator(FinePanel(spec), residual, self.RATES)

    def estimates(self, learned: Mapping[str, Any], spec: DisplaySpec) -> list[Estimate]:
        """Those of the ``DisplayModel``; what map and network took over is not among them."""
        return diagnose({name: value for name, value in learned["model"].items() if name != "fine"}, spec)
