"""A U-Net straight from a target to the phase at the panel: what a network does that knows no optics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

from annotated_types import Interval
from torch import Tensor, nn

from ...display.api import DisplaySpec
from ..hil.baselines import UNet
from ..learned.weights import draw_weights
from .fields import bounded, coloured
from .method import WIDTH, OnePass

LEVELS = 5  # halvings: a pixel sees most of a panel of 256 px, over which the optics spread its light


class PhaseUNet(nn.Module):
    """The U-Net of Ronneberger et al. 2015, whose output is the phase."""

    def __init__(self, spec: DisplaySpec, width: int) -> None:
        super().__init__()
        self.layers = draw_weights(UNet(1 + len(spec.wavelengths), 1, LEVELS, width), None)

    def forward(self, amplitude: Tensor) -> Tensor:
        """Amplitude ``(C, H, W)`` to phase ``(C, H, W)`` [rad]."""
        return bounded(self.layers(coloured(amplitude[:, None]))[:, 0])


@dataclass(frozen=True)
class UNetPhase(OnePass):
    """A U-Net from the target's amplitude to the phase, without any propagation in it.

    The other parameters are those of all one-pass networks. SI units throughout.

    Parameters
    ----------
    width : int
        Features at full resolution, doubled at every level.
    """

    rate: Annotated[float, Interval(gt=0, le=1)] = 1e-3
    width: Annotated[int, WIDTH] = 8

    title: ClassVar[str] = "U-Net straight to phase"

    def network(self, spec: DisplaySpec) -> nn.Module:
        """See the base."""
        return PhaseUNet(spec, self.width)
