"""A residual network predicts the complex hologram of an image, which is encoded by an anti-aliased double phase.

Shi, Li, Kim, Kellnhofer & Matusik, "Towards real-time photorealistic 3D holography with deep neural networks", Nature
591, 234 (2021).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

from torch import Tensor, nn
from torch.nn import functional

from ...display.api import DisplaySpec
from ...display.nominal import propagated
from ..common import unit_field
from ..double_phase import AntiAliasedDoublePhase
from ..learned.weights import draw_weights, start_at_zero
from .fields import coloured, double_phase
from .method import WIDTH, OnePass

BLOCKS = 4  # pairs of convolutions; 14 in the publication


class ResidualNetwork(nn.Module):
    """Convolutions of 3 x 3 px at full resolution in residual blocks of two, and what they make of an image encoded."""

    def __init__(self, spec: DisplaySpec, width: int) -> None:
        super().__init__()
        self.spec, self.antialiased = spec, AntiAliasedDoublePhase()
        self.first = nn.Conv2d(1 + len(spec.wavelengths), width, 3, padding=1)
        self.blocks = nn.ModuleList(nn.Conv2d(width, width, 3, padding=1) for _ in range(2 * BLOCKS))
        self.last = nn.Conv2d(width, 2, 3, padding=1)
        start_at_zero(draw_weights(self, None))

    def forward(self, amplitude: Tensor) -> Tensor:
        """Amplitude ``(C, H, W)`` to phase ``(C, H, W)`` [rad]."""
        x = self.first(coloured(amplitude[:, None]))
        for one, other in zip(self.blocks[::2], self.blocks[1::2], strict=True):
            x = x + other(functional.relu(one(functional.relu(x))))
        change, angle = self.last(functional.relu(x)).unbind(1)
        field = propagated((amplitude + change) * unit_field(angle), self.spec, back=True)
        return double_phase(self.antialiased.filter(field, self.spec.pitch))


@dataclass(frozen=True)
class TensorHolography(OnePass):
    """Tensor holography (Shi et al. 2021) of flat pictures, in a size for small panels and a CPU.

    The published network takes an image with depth, learns from computed holograms and focal stacks, and predicts the
    field in the middle of the scene. That of a flat picture is the image plane: predicted are a phase there and a
    change of the target's amplitude. An untrained network is `double_phase_aa`. The other parameters are those of all
    one-pass networks. SI units throughout.

    Parameters
    ----------
    width : int
        Features; 24 in the publication.
    """

    width: Annotated[int, WIDTH] = 12

    title: ClassVar[str] = "tensor holography"

    def network(self, spec: DisplaySpec) -> nn.Module:
        """See the base."""
        return ResidualNetwork(spec, self.width)
