"""The aberration approximator of the paper: a network from the ideal intensity to the captured one, Eq. 18-19."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Self

import torch
from torch import Tensor

from ...display.api import DisplaySpec
from ..common import matched, unit_field
from ..learned.retrieval import Image, Verdict
from ..learned.samples import Approximator, Sample
from ..learned.weights import refuse_other_weights
from .approximator_loss import PUBLISHED_RATES, ApproximatorLoss, LearningRates
from .critic import Critic
from .networks import Network
from .trainer import Trainer


class NetworkApproximator(Approximator):
    """D: ideal intensity to captured intensity, both in the region, all colours at once (Eq. 18-19).

    Parameters
    ----------
    spec : DisplaySpec
        Nominal optics in SI units.
    network : Network
        The generator and, where the loss asks for one, the discriminator.
    loss : ApproximatorLoss, optional
        Eq. 20; None: the network's published loss.
    with_critic : bool
        Train the critic of Eq. 22 beside it.
    seed : int
        Of the first weights.
    of_amplitude : bool
        Not in the paper: the network maps amplitudes, the square roots of both intensities.
    rates : LearningRates
        Of Adam.

    Attributes
    ----------
    gain, ideal_gain : Tensor
        Not in the paper: ``(C,)``, the units of captures and of ideal intensities, such that both are as bright as
        their targets in the first round; a camera would be exposed so. The identity, where training starts, then is of
        the right brightness.
    """

    def __init__(
        self,
        spec: DisplaySpec,
        network: Network,
        loss: ApproximatorLoss | None,
        with_critic: bool,
        seed: int,
        of_amplitude: bool = False,
        rates: LearningRates = PUBLISHED_RATES,
    ) -> None:
        channels = len(spec.wavelengths)
        self.spec = spec
        self.trainer = Trainer(network, loss, channels, seed, rates)
        self.gain = self.ideal_gain = torch.ones(channels)
        self.of_amplitude = of_amplitude
        self.critic = Critic(channels, network, seed) if with_critic else None

    def to(self, device: torch.device) -> Self:
        """Itself, before the first step, on a device; its weights were drawn on the CPU, the same for all devices."""
        self.trainer.to(device)
        self.gain, self.ideal_gain = self.gain.to(device), self.ideal_gain.to(device)
        if self.critic is not None:
            self.critic.to(device)
        return self

    @property
    def verdict(self) -> Verdict | None:
        """The adversarial loss of Eq. 22, where there is a critic."""
        return None if self.critic is None else self.critic.verdict

    @torch.no_grad()
    def expose(self, samples: Sequence[Sample]) -> None:
        """Set the gains from the first captures."""
        self.gain = _exposure((sample.capture, sample.target) for sample in samples)
        self.ideal_gain = _exposure((self._intensity(sample.phase, sample.light), sample.target) for sample in samples)

    def ideal(self, phase: Tensor, light: Tensor) -> Tensor:
        """|P(exp(i phase))|^2 in the region, ``(1, C, h, w)``, as bright as the targets were in the first round."""
        return (self.ideal_gain.view(-1, 1, 1) * self._intensity(phase, light))[None]

    def _intensity(self, phase: Tensor, light: Tensor) -> Tensor:
        channels = []
        for channel, panel in enumerate(phase):  # one at a time, for the memory
            model = self.spec.propagator(channel, device=panel.device)
            field = self.spec.region.crop(model.forward(unit_field(panel)))
            channels.append((field.real.square() + field.imag.square()) / light[channel])
        return torch.stack(channels)

    def _encoded(self, intensity: Tensor) -> Tensor:
        return intensity.clamp_min(1e-12).sqrt() if self.of_amplitude else intensity

    def step(self, sample: Sample, progress: float) -> dict[str, float]:
        """One step on a capture of the trainer (Eq. 20), and of the critic (Eq. 22), whose rate is constant."""
        with torch.no_grad():
            ideal = self._encoded(self.ideal(sample.phase, sample.light))
            capture = self._encoded((self.gain.view(-1, 1, 1) * sample.capture)[None])
        losses = self.trainer.step(ideal, capture, progress)
        if self.critic is not None:
            with torch.no_grad():
                predicted = self.trainer.generator(ideal)[0]
            losses["judge"] = self.critic.step(matched(predicted, sample.target)[None], sample.target[None])
        return losses

    def image(self, light: Tensor) -> Image:
        """The display with the weights as they are now, held."""
        network = self.trainer.frozen()

        def display(phase: Tensor) -> Tensor:
            predicted = network(self._encoded(self.ideal(phase, light)))[0]
            return (predicted.square() if self.of_amplitude else predicted) / self.gain.view(-1, 1, 1)

        return display

    def state_dict(self) -> dict[str, Any]:
        """All that the next step depends on."""
        critic = None if self.critic is None else self.critic.state_dict()
        return {"trainer": self.trainer.state_dict(), "gains": self._gains(), "judge": critic}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go on from a state."""
        self.trainer.load_state_dict(state["trainer"])
        self._set_gains(state["gains"])
        if self.critic is not None:
            self.critic.load_state_dict(state["judge"])

    def learned(self) -> dict[str, Any]:
        """What phase retrieval needs, and which features the perceptual loss compared."""
        weights: dict[str, Any] = {"generator": self.trainer.generator.state_dict(), "gains": self._gains()}
        weights["perceptual"] = None if self.trainer.perceptual is None else self.trainer.perceptual.name
        if self.critic is not None:
            weights["judge"] = self.critic.network.state_dict()
        return weights

    def load_learned(self, weights: Mapping[str, Any]) -> None:
        """UserError for the weights of another network."""
        with refuse_other_weights():
            self.trainer.generator.load_state_dict(weights["generator"])
            self._set_gains(weights["gains"])
            if self.critic is not None:
                self.critic.network.load_state_dict(weights["judge"])

    def _gains(self) -> Tensor:
        return torch.stack([self.gain, self.ideal_gain])

    def _set_gains(self, gains: Tensor) -> None:
        self.gain, self.ideal_gain = gains.to(self.gain.device)


def _exposure(pairs: Iterable[tuple[Tensor, Tensor]]) -> Tensor:
    """One factor a colour, ``(C,)``, that makes images ``(C, h, w)`` as bright as their targets, by least squares."""
    products = [torch.stack([image * target, image.square()]).sum((-2, -1)) for image, target in pairs]
    overlap, power = torch.stack(products).sum(0)
    return overlap / power.clamp_min(1e-12)
