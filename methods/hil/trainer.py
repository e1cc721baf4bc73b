"""Training the aberration approximator: one step of its network and of the adversary.

Chakravarthula et al. 2020, Sections 4.3.1 and 5.2.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Self

import torch
from torch import Tensor, nn
from torch.nn import functional

from ...core import seeds
from ...core.errors import UserError
from ..descent import cosine_decay
from ..learned.weights import load_moments, seeded
from .approximator_loss import (
    BETAS,
    PUBLISHED_RATES,
    ApproximatorLoss,
    LearningRates,
    adversarial_loss,
    discriminator_loss,
    feature_matching_loss,
    published_loss,
)
from .networks import FromIdentity, Network
from .perceptual import perceptual_loss


class Trainer:
    """A generator and, if the loss asks for one, a discriminator, with an Adam optimiser each (Section 5.2).

    For intensities with so many channels; ``loss`` None takes the published one. A step draws the random numbers of
    dropout from its own and leaves torch's as they are. Raises UserError where the loss needs a discriminator and the
    network has none.
    """

    def __init__(
        self,
        network: Network,
        loss: ApproximatorLoss | None,
        channels: int,
        seed: int,
        rates: LearningRates = PUBLISHED_RATES,
    ) -> None:
        self.loss, self.rates = published_loss(network) if loss is None else loss, rates
        with seeded("aberration approximator", seed):
            generator = network.generator(channels, channels)
            self.generator = generator if network.name == "identity" else FromIdentity(generator)
            self.discriminator = network.discriminator(channels) if self.loss.needs_discriminator else None
        if self.loss.needs_discriminator and self.discriminator is None:
            raise UserError(f"loss: network '{network.name}' has no discriminator; set 'adversarial' to 0")
        self.perceptual = perceptual_loss() if self.loss.perceptual else None
        self._noise = seeds.generator("dropout", seed).get_state()
        self._optimisers = self._fresh_optimisers()

    def to(self, device: torch.device) -> Self:
        """Itself, before the first step, on a device; the random numbers for dropout stay on the CPU."""
        for module in (self.generator, self.discriminator, self.perceptual):
            if module is not None:
                module.to(device)
        self._optimisers = self._fresh_optimisers()
        return self

    def _fresh_optimisers(self) -> dict[str, torch.optim.Adam]:
        return {
            name: torch.optim.Adam(module.parameters(), lr=getattr(self.rates, name), betas=BETAS, fused=True)
            for name, module in (("generator", self.generator), ("discriminator", self.discriminator))
            if module is not None and any(True for _ in module.parameters())
        }

    def step(self, ideal: Tensor, capture: Tensor, progress: float = 0.0) -> dict[str, float]:
        """One step of the discriminator, then one of the generator, on intensities ``(B, C, h, w)``; the losses before.

        progress: the share of the round's steps before this one.

        Keys: "l1", "l2", "perceptual", "adversarial", "feature_matching" without their weights (0 where the weight is,
        but for l1), "total" with them, "discriminator". Raises ValueError for images that do not belong together.
        """
        if self.rates.decay and "generator" in self._optimisers:
            for group in self._optimisers["generator"].param_groups:
                group["lr"] = cosine_decay(self.rates.generator, progress)
        self.generator.train().requires_grad_(True)
        with self._own_noise():
            predicted = self.generator(ideal)
        if predicted.shape != capture.shape:
            raise ValueError(f"prediction {tuple(predicted.shape)} and capture {tuple(capture.shape)} differ in shape")
        judgement = self._step_discriminator(predicted.detach(), ideal, capture)
        return self._step_generator(predicted, ideal, capture) | {"discriminator": judgement}

    def frozen(self) -> nn.Module:
        """The generator as it is now, for phase retrieval: a copy without dropout whose weights are constants."""
        return copy.deepcopy(self.generator).eval().requires_grad_(False)

    def _step_discriminator(self, predicted: Tensor, ideal: Tensor, capture: Tensor) -> float:
        if self.discriminator is None:
            return 0.0
        judged = self.discriminator.judge(predicted, ideal), self.discriminator.judge(capture, ideal)
        return self._descend("discriminator", discriminator_loss(*judged, self.loss.gan))

    def _step_generator(self, predicted: Tensor, ideal: Tensor, capture: Tensor) -> dict[str, float]:
        terms = self._terms(predicted, ideal, capture)
        total = torch.stack([getattr(self.loss, name) * term for name, term in terms.items()]).sum()
        losses = dict.fromkeys(("l1", "l2", "perceptual", "adversarial", "feature_matching"), 0.0)
        losses["l1"] = float(functional.l1_loss(predicted.detach(), capture))
        losses |= {name: float(term.detach()) for name, term in terms.items()}
        return losses | {"total": self._descend("generator", total)}

    def _terms(self, predicted: Tensor, ideal: Tensor, capture: Tensor) -> dict[str, Tensor]:
        """The terms of Eq. 20 that have a weight, without it."""
        loss, terms = self.loss, {}
        if loss.l1:
            terms["l1"] = functional.l1_loss(predicted, capture)
        if loss.l2:
            terms["l2"] = functional.mse_loss(predicted, capture)
        if self.perceptual is not None:
            terms["perceptual"] = self.perceptual(predicted, capture)
        if self.discriminator is not None:
            judged = self.discriminator.judge(predicted, ideal)
            if loss.adversarial:
                terms["adversarial"] = adversarial_loss(judged, 1.0, loss.gan)
            if loss.feature_matching:
                with torch.no_grad():
                    captured = self.discriminator.judge(capture, ideal)
                terms["feature_matching"] = feature_matching_loss(judged, captured)
        return terms

    def _descend(self, name: str, loss: Tensor) -> float:
        """One step of an optimiser, in its own parameters only; none for a network without parameters."""
        optimiser = self._optimisers.get(name)
        if optimiser is not None:
            optimiser.zero_grad()
            loss.backward(inputs=[value for group in optimiser.param_groups for value in group["params"]])
            optimiser.step()
        return float(loss.detach())

    @contextmanager
    def _own_noise(self) -> Iterator[None]:
        with torch.random.fork_rng(devices=[]):
            torch.set_rng_state(self._noise)
            yield
            self._noise = torch.get_rng_state()

    def _perceptual_name(self) -> str | None:
        return None if self.perceptual is None else self.perceptual.name

    def state_dict(self) -> dict[str, Any]:
        """All that the next step depends on: tensors that are still in use, so save or copy them before the next."""
        return {
            "generator": self.generator.state_dict(),
            "discriminator": None if self.discriminator is None else self.discriminator.state_dict(),
            "optimisers": {name: optimiser.state_dict()["state"] for name, optimiser in self._optimisers.items()},
            "noise": self._noise,
            "perceptual": self._perceptual_name(),
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go on from a state of the same networks and loss; UserError for one that does not fit."""
        try:
            if state["perceptual"] != self._perceptual_name():
                raise ValueError(f"its perceptual loss is '{state['perceptual']}', not '{self._perceptual_name()}'")
            self.generator.load_state_dict(state["generator"])
            if self.discriminator is not None:
                self.discriminator.load_state_dict(state["discriminator"])
            for name, optimiser in self._optimisers.items():
                load_moments(optimiser, state["optimisers"][name])
            noise = state["noise"].cpu()
            with torch.random.fork_rng(devices=[]):
                torch.set_rng_state(noise)
            self._noise = noise.clone()
        except (KeyError, TypeError, AttributeError, RuntimeError, ValueError) as error:
            reason = (str(error).splitlines() or [type(error).__name__])[0]
            raise UserError(f"the saved training does not fit: {reason}; remove it to train anew") from error
