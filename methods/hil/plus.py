"""HIL with the aberration field of Eq. 13 kept as a field: a physical model of the display learns from the captures.

It departs from Chakravarthula et al. 2020 where the captures say that its form loses most: the paper's network sees the
ideal intensity alone, and intensity does not tell how the aberration field interferes (Eq. 13, cos(Delta theta)) nor
what a look-up table does to a wrap. Captures, rounds and retrieval are those of ``hil``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

from annotated_types import Interval
from torch import nn

from ...core.errors import UserError
from ...display.api import DisplaySpec
from ..calibrated.approximator import ModelApproximator, Rates
from ..calibrated.diagnosis import Diagnosed
from ..calibrated.display_model import DisplayModel
from ..calibrated.method import ThroughModel
from ..calibrated.terms import Haze
from ..learned.samples import Schedule
from ..learned.weights import seeded, start_at_zero
from .networks import Network

RATES = Rates(model=1e-2, network=3e-4)


def residual_network(
    spec: DisplaySpec, network: Network, inputs: int, seed: int, draw: str = "residual network"
) -> nn.Module:
    """A generator that adds to the prediction of a model and starts at zero; inputs: images a colour that it sees;
    draw: names its random numbers.

    The physics is learned first, and the network learns what it leaves.
    """
    channels = len(spec.wavelengths)
    with seeded(draw, seed):
        return start_at_zero(network.generator(inputs * channels, channels))


@dataclass(frozen=True)
class MostImages(Schedule):
    """That of `hil`, of whose 48 captures in the first round three are of dark patterns."""

    images: Annotated[int, Interval(ge=1)] | None = 45


@dataclass(frozen=True)
class HILPlus(Diagnosed, ThroughModel):
    """The loop of `hil` with a physical model of the display, learned from captures, in the place of its network.

    The aberration field of Eq. 13 stays a complex field. The parameters but for the network are those of all calibrated
    methods. SI units throughout.

    Parameters
    ----------
    network : Network, optional
        A generator that adds to what the display model predicts; none by default, since it gained nothing on held-out
        images (22.09 dB without, 21.90 dB with it after a first round of 64 captures).
    """

    training: MostImages = MostImages()
    network: Network | None = None

    title: ClassVar[str] = "hardware in the loop through a physical model"
    version: ClassVar[int] = 6

    def approximator(self, spec: DisplaySpec) -> ModelApproximator:
        """The display model, untrained, with a network if there is one; UserError for a network with dropout."""
        if self.network is None:
            return ModelApproximator(DisplayModel(spec), None, RATES, Haze(spec))
        if self.network.dropout or self.network.name == "pix2pix":
            raise UserError(
                "hil_plus: a residual network has no dropout, whose random numbers a resumed training lacks"
            )
        network = residual_network(spec, self.network, 4, self.seed)
        return ModelApproximator(DisplayModel(spec), network, RATES, Haze(spec))
