"""Training the aberration approximator: its loss, Eq. 20, and one step of both optimisers.

Chakravarthula et al. 2020, Sections 4.3.1 and 5.2.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self

import torch
from annotated_types import Interval
from torch import Tensor, nn
from torch.nn import functional

from ...core import seeds
from ...core.errors import UserError
from .networks import Discriminator, Network
from .perceptual import find_weights, perceptual_loss

Weight = Annotated[float, Interval(ge=0, le=1e6)]
Gan = Literal["cross_entropy", "least_squares"]

LEARNING_RATE = 2e-4
BETAS = (0.5, 0.999)


@dataclass(frozen=True)
class Objective:
    """Weights of the generator's loss, by default those of Eq. 20; a term of weight 0 is not computed.

    l1, l2: mean absolute and mean squared error. perceptual: Eq. 21. adversarial: the discriminator's verdict, by
    cross entropy or least squares (``gan``). feature_matching: mean absolute differences of the discriminator's
    features, summed over layers and scales (T.-C. Wang et al. 2018, Eq. 4).
    """

    l1: Weight = 10.0
    l2: Weight = 0.0
    perceptual: Weight = 0.05
    adversarial: Weight = 0.5
    feature_matching: Weight = 0.0
    gan: Gan = "cross_entropy"

    def __post_init__(self) -> None:
        if not any((self.l1, self.l2, self.perceptual, self.adversarial, self.feature_matching)):
            raise UserError("loss: every weight is 0; give at least one of l1, l2, perceptual, adversarial a weight")

    @property
    def needs_discriminator(self) -> bool:
        """Does a term ask the discriminator?"""
        return self.adversarial > 0 or self.feature_matching > 0


def published_objective(network: Network) -> Objective:
    """The loss a network is published with; for U-Net, which is published for segmentation, the paper's L1.

    Pix2PixHD's perceptual term needs VGG-19 and is left out without its weights.
    """
    if network.name == "pix2pix":
        return Objective(l1=100.0, perceptual=0.0, adversarial=1.0)
    if network.name == "pix2pixhd":
        perceptual = 10.0 if find_weights() else 0.0
        return Objective(0.0, 0.0, perceptual, adversarial=1.0, feature_matching=10.0, gan="least_squares")
    if network.name in ("unet", "identity"):
        return Objective(l1=1.0, perceptual=0.0, adversarial=0.0)
    return Objective()


def adversarial_loss(judged: list[list[Tensor]], wanted: float, gan: Gan) -> Tensor:
    """Distance of a discriminator's logits from ``wanted``, 1: capture, 0: prediction; averaged, summed over scales."""
    compare = functional.binary_cross_entropy_with_logits if gan == "cross_entropy" else functional.mse_loss
    verdicts = [activations[-1] for activations in judged]
    return torch.stack([compare(verdict, torch.full_like(verdict, wanted)) for verdict in verdicts]).sum()


def feature_matching_loss(judged: list[list[Tensor]], captured: list[list[Tensor]]) -> Tensor:
    """Mean absolute difference of each layer's features, the logits apart, summed over layers and scales."""
    scales = zip(judged, captured, strict=True)
    differences = [
        functional.l1_loss(a, b) for ours, theirs in scales for a, b in zip(ours[:-1], theirs[:-1], strict=True)
    ]
    return torch.stack(differences).sum()


class Trainer:
    """A generator and, if the loss asks for one, a discriminator, with an Adam optimiser each (Section 5.2).

    noise: state of the random numbers for dropout; a step draws from its own and leaves torch's as they are.
    """

    def __init__(
        self, generator: nn.Module, discriminator: Discriminator | None, loss: Objective, noise: Tensor
    ) -> None:
        self.generator, self.discriminator, self.loss = generator, discriminator, loss
        self.perceptual = perceptual_loss() if loss.perceptual else None
        self._noise = noise
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
            name: torch.optim.Adam(module.parameters(), lr=LEARNING_RATE, betas=BETAS, fused=True)
            for name, module in (("generator", self.generator), ("discriminator", self.discriminator))
            if module is not None and any(True for _ in module.parameters())
        }

    def step(self, ideal: Tensor, capture: Tensor) -> dict[str, float]:
        """One step of the discriminator, then one of the generator, on intensities ``(B, C, h, w)``; the losses before.

        Keys: "l1", "l2", "perceptual", "adversarial", "feature_matching" without their weights (0 where the weight is,
        but for l1), "total" with them, "discriminator". Raises ValueError for images that do not belong together.
        """
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
        wrong = adversarial_loss(self.discriminator.judge(predicted, ideal), 0.0, self.loss.gan)
        missed = adversarial_loss(self.discriminator.judge(capture, ideal), 1.0, self.loss.gan)
        loss = (wrong + missed) / 2  # halved to slow it down against the generator (Isola et al., Section 3.3)
        return self._descend("discriminator", loss)

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


def load_moments(optimiser: torch.optim.Adam, state: dict[int, dict[str, Tensor]]) -> None:
    """Copies of Adam's moments in the layout of the parameters, which the fused step takes for granted, as it does the
    number of steps on their device.

    Raises ValueError where a shape is not the parameter's.
    """
    optimiser.load_state_dict({"state": state, "param_groups": optimiser.state_dict()["param_groups"]})
    for parameter, values in optimiser.state.items():
        place = parameter.device if optimiser.defaults["fused"] else "cpu"
        values["step"] = torch.tensor(float(values["step"]), device=place)
        for moment in ("exp_avg", "exp_avg_sq"):
            if values[moment].shape != parameter.shape:
                raise ValueError(f"{moment} {tuple(values[moment].shape)} for a parameter {tuple(parameter.shape)}")
            values[moment] = torch.empty_like(parameter).copy_(values[moment])


def trainer(network: Network, loss: Objective | None, inputs: int, outputs: int, seed: int) -> Trainer:
    """A fresh trainer for intensities with so many channels; ``loss`` None takes the published one.

    Raises UserError where the loss needs a discriminator and the network has none.
    """
    loss = published_objective(network) if loss is None else loss
    with torch.random.fork_rng(devices=[]):
        torch.set_rng_state(seeds.generator("aberration approximator", seed).get_state())
        generator = network.generator(inputs, outputs)
        discriminator = network.discriminator(outputs, inputs) if loss.needs_discriminator else None
    if loss.needs_discriminator and discriminator is None:
        raise UserError(f"loss: network '{network.name}' has no discriminator; set 'adversarial' to 0")
    return Trainer(generator, discriminator, loss, seeds.generator("dropout", seed).get_state())
