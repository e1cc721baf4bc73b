"""HIL with the aberration field of Eq. 13 kept as a field: a physical model of the display learns from the captures.

It departs from Chakravarthula et al. 2020 where the captures say that its form loses most: the paper's network sees the
ideal intensity alone, and intensity does not tell how the aberration field interferes (Eq. 13, cos(Delta theta)) nor
what a look-up table does to a wrap. Captures, rounds and retrieval are those of ``hil``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import torch
from torch import nn

from ...core import seeds
from ...core.errors import UserError
from ..calibrated.approximator import ModelApproximator, Rates, start_at_zero
from ..calibrated.diagnosis import Diagnosed
from ..calibrated.method import ThroughModel
from ..display_model import DisplayModel
from .networks import Network

if TYPE_CHECKING:
    from ...display.api import DisplaySpec

RATES = Rates(model=1e-2, network=3e-4)


class PlusApproximator(ModelApproximator):
    """|field of the display model|^2 and, if there is a network, what it adds; both learn from the same captures.

    The network's last layer starts at zero, so the physics is learned first and the network learns what it leaves.
    """

    def __init__(self, spec: DisplaySpec, network: Network | None, seed: int) -> None:
        if network is not None and (network.dropout or network.name == "pix2pix"):
            raise UserError(
                "hil_plus: a residual network has no dropout, whose random numbers a resumed training lacks"
            )
        super().__init__(DisplayModel(spec), _residual(spec, network, seed), RATES)


def _residual(spec: DisplaySpec, network: Network | None, seed: int) -> nn.Module | None:
    if network is None:
        return None
    channels = len(spec.wavelengths)
    with torch.random.fork_rng(devices=[]):
        torch.set_rng_state(seeds.generator("residual network", seed).get_state())
        return start_at_zero(network.generator(3 * channels, channels))


@dataclass(frozen=True)
class HILPlus(Diagnosed, ThroughModel):
    """Hardware in the loop with the aberration field as a field; see this file's first lines.

    network: a generator that adds to what the display model predicts; none by default, since it gained nothing on
    held-out images (22.09 dB without, 21.90 dB with it after a first round of 64 captures). training: Algorithm 1.
    """

    network: Network | None = None

    version: ClassVar[int] = 3

    def approximator(self, spec: DisplaySpec) -> PlusApproximator:
        """The display model, untrained, with a network if there is one."""
        return PlusApproximator(spec, self.network, self.seed)
