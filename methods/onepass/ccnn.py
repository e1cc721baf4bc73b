"""Two complex-valued networks, one on each side of the propagation.

Zhong, Sang, Yan, Li, Chen, Qin, Chen & Ye, "Real-time high-quality computer-generated hologram using complex-valued
convolutional neural network", IEEE Trans. Vis. Comput. Graph. 30, 3709 (2024).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor, nn
from torch.nn import functional

from ...display.api import DisplaySpec
from ...display.nominal import propagated
from ...optics.phasor import phasor
from ..hil.generator import crop_to, pad_to_multiple
from ..learned.samples import Steps
from ..learned.weights import draw_weights
from .fields import coloured
from .method import WIDTH, OnePass


class ComplexUNet(nn.Module):
    """Complex convolutions of 3 x 3 px and stride 2, and as many transposed ones of 4 px back.

    Features double from level to level and are added across. Between layers ReLU acts on real and imaginary part. Any
    size: it is padded with zeros.
    """

    def __init__(self, inputs: int, levels: int, width: int) -> None:
        super().__init__()
        self.levels = levels
        widths = [width * 2**level for level in range(levels)]
        down, up = pairwise([inputs, *widths]), pairwise([*widths[::-1], 1])
        self.down = nn.ModuleList(nn.Conv2d(*sizes, 3, 2, 1, dtype=torch.complex64) for sizes in down)
        self.up = nn.ModuleList(nn.ConvTranspose2d(*sizes, 4, 2, 1, dtype=torch.complex64) for sizes in up)

    def forward(self, field: Tensor) -> Tensor:
        """``(B, inputs, H, W)`` to ``(B, H, W)``, both complex."""
        x, taken = pad_to_multiple(field, 2**self.levels), []
        for layer in self.down:
            x = _rectified(layer(x))
            taken.append(x)
        x = taken.pop()
        for layer in self.up:
            x = layer(x)
            if taken:
                x = _rectified(x) + taken.pop()
        return crop_to(x, *field.shape[-2:])[:, 0]


def _rectified(x: Tensor) -> Tensor:
    return torch.complex(functional.relu(x.real), functional.relu(x.imag))


class TwoComplexNetworks(nn.Module):
    """image: target amplitude to the phase that its field gets. panel: field at the panel to that whose phase is shown.

    Four and three levels, as in the publication.
    """

    def __init__(self, spec: DisplaySpec, width: int) -> None:
        super().__init__()
        self.spec, inputs = spec, 1 + len(spec.wavelengths)
        self.image = draw_weights(ComplexUNet(inputs, 4, width), None)
        self.panel = draw_weights(ComplexUNet(inputs, 3, width), None)

    def forward(self, amplitude: Tensor) -> Tensor:
        """Amplitude ``(C, H, W)`` to phase ``(C, H, W)`` [rad]."""
        angle = self.image(coloured(amplitude[:, None]).to(torch.complex64)).angle()
        field = propagated(phasor(amplitude, angle), self.spec, back=True)
        shown: Tensor = self.panel(coloured(field[:, None]))
        return shown.angle()


@dataclass(frozen=True)
class CCNN(OnePass):
    """Complex-valued networks (Zhong et al. 2024): one gives the target's field its phase, one the panel its phase.

    The publication has a pair for each colour. The other parameters are those of all one-pass networks. SI units
    throughout.

    Parameters
    ----------
    width : int
        Features of the first level, doubled at every level; 4 in the publication.
    """

    steps: Steps = 1500
    rate: Annotated[float, Interval(gt=0, le=1)] = 5e-3
    width: Annotated[int, WIDTH] = 8

    title: ClassVar[str] = "complex-valued networks"

    def network(self, spec: DisplaySpec) -> nn.Module:
        """See the base."""
        return TwoComplexNetworks(spec, self.width)
