"""The additional adversarial loss of phase retrieval: does a predicted picture pass for a target?"""

from __future__ import annotations

from typing import Any, Self

import torch
from torch import Tensor

from ..learned.weights import draw_weights, load_moments, seeded
from .approximator_loss import BETAS, LEARNING_RATE, adversarial_loss, discriminator_loss
from .discriminator import PatchDiscriminator
from .networks import PIX2PIX_DEVIATION, Network


class Critic:
    """A PatchGAN that tells targets from predicted pictures (Chakravarthula et al. 2020, Section 4.4).

    Not in the paper: what its additional adversarial loss sees. Here the critic is trained in Algorithm 1 beside the
    approximator, on the training targets and on what their holograms are predicted to show, both in linear light and
    without a condition, and it is frozen in the retrieval of unseen images.
    """

    def __init__(self, channels: int, network: Network, seed: int) -> None:
        with seeded("judge", seed):
            self.network = draw_weights(PatchDiscriminator(channels, 0, network.filters), PIX2PIX_DEVIATION)
        self.to(torch.device("cpu"))

    def to(self, device: torch.device) -> Self:
        """Itself, before the first step, on a device."""
        self.network.to(device)
        self._optimiser = torch.optim.Adam(self.network.parameters(), lr=LEARNING_RATE, betas=BETAS, fused=True)
        return self

    def step(self, picture: Tensor, target: Tensor) -> float:
        """One step on a predicted picture and a target ``(1, C, h, w)``; the loss before it."""
        self.network.requires_grad_(True)
        judged = self.network.judge(picture, picture), self.network.judge(target, target)
        loss = discriminator_loss(*judged, "cross_entropy")
        self._optimiser.zero_grad()
        loss.backward()
        self._optimiser.step()
        return float(loss.detach())

    def verdict(self, picture: Tensor) -> Tensor:
        """Adversarial loss of a picture ``(1, C, h, w)``: small where it passes for a target."""
        self.network.requires_grad_(False)
        return adversarial_loss(self.network.judge(picture, picture), 1.0, "cross_entropy")

    def state_dict(self) -> dict[str, Any]:
        """All that the next step depends on."""
        return {"network": self.network.state_dict(), "optimiser": self._optimiser.state_dict()["state"]}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go on from a state."""
        self.network.load_state_dict(state["network"])
        load_moments(self._optimiser, state["optimiser"])
