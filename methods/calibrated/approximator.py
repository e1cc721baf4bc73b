"""Any differentiable model of a display, and how it learns from captures."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import torch
from torch import Tensor, nn
from torch.nn import functional

from ...core.errors import UserError
from ...optics.phasor import squared_modulus
from ..descent import cosine_decay
from ..hil.loop import Sample
from ..hil.objective import load_moments
from ..hil.retrieval import Image

BETAS = (0.9, 0.99)


@dataclass(frozen=True)
class Rates:
    """Adam's first rate in every round, of the model and of the network that adds to it."""

    model: float
    network: float = 3e-4


class ModelApproximator:
    """What a model makes of a phase and, if there is a network, what it adds; both learn from the same captures.

    model: phase ``(C, H, W)`` [rad] to the field (complex) or the intensity (real) in the region, ``(C, h, w)``, where
    the light on the panel is 1. network: intensity, real and imaginary part of every colour, ``(1, 3 C, h, w)``, to
    what is added to the intensity; it needs a model that gives a field.
    """

    def __init__(self, model: nn.Module, network: nn.Module | None, rates: Rates) -> None:
        self.model, self.network = model, network
        self._rates = [rates.model, rates.network][: 1 if network is None else 2]
        self._optimiser = self._fresh_optimiser()

    def to(self, device: torch.device) -> Self:
        """Itself, before the first step, on a device."""
        self.model.to(device)
        if self.network is not None:
            self.network.to(device)
        self._optimiser = self._fresh_optimiser()
        return self

    def _fresh_optimiser(self) -> torch.optim.Adam:
        modules = [self.model] if self.network is None else [self.model, self.network]
        pairs = zip(modules, self._rates, strict=True)
        return torch.optim.Adam([{"params": list(one.parameters()), "lr": rate} for one, rate in pairs], betas=BETAS)

    def expose(self, samples: Sequence[Sample]) -> None:
        """Nothing to choose: a model has a brightness of its own."""

    def step(self, sample: Sample, progress: float) -> dict[str, float]:
        """One step on the absolute error of a capture, relative to the capture's brightness. The rates fall to zero
        along half a cosine in every round, of which ``progress`` is done."""
        for group, rate in zip(self._optimiser.param_groups, self._rates, strict=True):
            group["lr"] = cosine_decay(rate, progress)
        predicted = predicted_capture(self.model, self.network, sample.phase, sample.light)
        loss = functional.l1_loss(predicted, sample.capture) / sample.capture.mean()
        self._optimiser.zero_grad()
        loss.backward()
        self._optimiser.step()
        return {"l1": float(loss.detach())}

    def image(self, light: Tensor) -> Image:
        """The display with the parameters as they are now, held."""
        model, network = copy.deepcopy((self.model, self.network))
        model.requires_grad_(False)
        if network is not None:
            network.requires_grad_(False)
        return lambda phase: predicted_capture(model, network, phase, light)

    def state_dict(self) -> dict[str, Any]:
        """All that the next step depends on."""
        return {**self.learned(), "optimiser": self._optimiser.state_dict()["state"]}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go on from a state."""
        self.load_learned(state)
        load_moments(self._optimiser, state["optimiser"])

    def learned(self) -> dict[str, Any]:
        """What phase retrieval needs."""
        network = None if self.network is None else self.network.state_dict()
        return {"model": self.model.state_dict(), "network": network}

    def load_learned(self, weights: Mapping[str, Any]) -> None:
        """UserError for the weights of another network."""
        try:
            self.model.load_state_dict(weights["model"])
            if self.network is not None:
                self.network.load_state_dict(weights["network"])
        except (KeyError, TypeError, AttributeError, RuntimeError) as error:
            reason = " ".join(str(error).split())[:160]
            raise UserError(f"these are not the weights of this network ({reason}); train it anew") from error


def predicted_capture(model: nn.Module, network: nn.Module | None, phase: Tensor, light: Tensor) -> Tensor:
    """Phase ``(C, H, W)`` [rad] to the capture ``(C, h, w)`` in the unit of ``light`` ``(C,)``."""
    shown: Tensor = model(phase)
    if not shown.is_complex():
        return shown / light[:, None, None]
    field = shown / light.sqrt()[:, None, None]
    intensity = squared_modulus(field)
    if network is None:
        return intensity
    added: Tensor = network(torch.cat([intensity, field.real, field.imag])[None])[0]
    return intensity + added


def start_at_zero(network: nn.Module) -> nn.Module:
    """A network whose last convolution gives zero: what it adds to is learned first, and it learns what that leaves."""
    last = [one for one in network.modules() if isinstance(one, nn.Conv2d | nn.ConvTranspose2d)][-1]
    nn.init.zeros_(last.weight)
    if last.bias is not None:
        nn.init.zeros_(last.bias)
    return network
