"""HoloNet: a network chooses the phase at the image plane, another one encodes the field at the panel.

Peng, Choi, Padmanaban & Wetzstein, "Neural holography with camera-in-the-loop training", ACM Trans. Graph. 39(6), 185
(2020).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import torch
from annotated_types import Interval
from torch import Tensor, nn

from ...display.api import DisplaySpec
from ...display.nominal import propagated
from ...optics.phasor import phasor
from ..hil.baselines import UNet
from ..learned.weights import draw_weights, start_at_zero
from .fields import bounded, coloured, double_phase
from .method import WIDTH, OnePass

Encoding = Literal["double_phase", "phase"]


class HoloNetwork(nn.Module):
    """Two U-Nets around the way from the image plane to the panel.

    image: target amplitude to the phase that its field gets. panel: amplitude of the field at the panel, and cosine and
    sine of its encoding, to what is added to that encoding.
    """

    def __init__(self, spec: DisplaySpec, width: int, levels: int, corrects: Encoding) -> None:
        super().__init__()
        colours = len(spec.wavelengths)
        self.spec, self.encode = spec, double_phase if corrects == "double_phase" else torch.angle
        self.image = start_at_zero(draw_weights(UNet(1 + colours, 1, levels, width), None))
        self.panel = start_at_zero(draw_weights(UNet(3 + colours, 1, levels, width), None))

    def forward(self, amplitude: Tensor) -> Tensor:
        """Amplitude ``(C, H, W)`` to phase ``(C, H, W)`` [rad]."""
        angle = bounded(self.image(coloured(amplitude[:, None]))[:, 0])
        field = propagated(phasor(amplitude, angle), self.spec, back=True)
        encoded, light = self.encode(field), field.abs()
        light = light / light.amax((-2, -1), keepdim=True).clamp_min(torch.finfo(light.dtype).tiny)
        seen = torch.stack([light, encoded.cos(), encoded.sin()], 1)
        phase: Tensor = encoded + bounded(self.panel(coloured(seen))[:, 0])
        return phase


@dataclass(frozen=True)
class HoloNet(OnePass):
    """HoloNet (Peng et al. 2020), in a size for small panels and a CPU.

    The paper's encoder gives the phase itself; here it corrects an encoding, which an untrained HoloNet is. The way
    back to the panel is that of the nominal optics also where ``through: parametric_model`` trains the networks for a
    display that was photographed, in the paper that of its calibrated model. The other parameters are those of all
    one-pass networks. SI units throughout.

    Parameters
    ----------
    width : int
        Features of both networks at full resolution, doubled at every level.
    levels : int
        Halvings of the resolution.
    corrects : {"double_phase", "phase"}
        Encoding of the field at the panel that the second network corrects. phase: that of the field, without its
        amplitude; through a model with crosstalk, the checkerboard of a double phase kept a training from converging.
    """

    width: Annotated[int, WIDTH] = 8
    levels: Annotated[int, Interval(ge=1, le=8)] = 3
    corrects: Encoding = "double_phase"

    title: ClassVar[str] = "HoloNet"

    def network(self, spec: DisplaySpec) -> nn.Module:
        """See the base."""
        return HoloNetwork(spec, self.width, self.levels, self.corrects)
