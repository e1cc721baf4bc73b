"""Any differentiable model of a display, and how it learns from captures."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import torch
from torch import Tensor, nn
from torch.nn import functional

from ...optics.phasor import squared_modulus
from ..descent import cosine_decay
from ..learned.retrieval import Image
from ..learned.samples import Sample
from ..learned.weights import load_moments, refuse_other_weights

MODEL_BETAS = (0.9, 0.99)


@dataclass(frozen=True)
class Rates:
    """Adam's first rate in every round, of the model and of the network that adds to it."""

    model: float
    network: float = 3e-4


class PredictedCapture(nn.Module):
    """What a model makes of a phase and, if there is a network, what it adds.

    model: phase ``(C, H, W)`` [rad] to the field (complex) or the intensity (real) in the region, ``(C, h, w)``, where
    the light on the panel is 1. network: intensity, real and imaginary part of every colour, ``(1, 3 C, h, w)``, to
    what is added to the intensity; it needs a model that gives a field.
    """

    def __init__(self, model: nn.Module, network: nn.Module | None) -> None:
        super().__init__()
        self.model, self.network = model, network

    def forward(self, phase: Tensor, light: Tensor) -> Tensor:
        """Phase ``(C, H, W)`` [rad] to the capture ``(C, h, w)`` in the unit of ``light`` ``(C,)``."""
        output: Tensor = self.model(phase)
        if not output.is_complex():
            return output / light[:, None, None]
        field = output / light.sqrt()[:, None, None]
        intensity = squared_modulus(field)
        if self.network is None:
            return intensity
        added: Tensor = self.network(torch.cat([intensity, field.real, field.imag])[None])[0]
        return intensity + added


class ModelApproximator:
    """A model of the display and the network that adds to it, see ``CAPTURE``; both learn from one loss."""

    CAPTURE: ClassVar[type[PredictedCapture]] = PredictedCapture
    LOSS: ClassVar[str] = "l1"

    def __init__(self, model: nn.Module, network: nn.Module | None, rates: Rates) -> None:
        self.model, self.network = model, network
        self._capture = self.CAPTURE(model, network)
        self._learners = [(model, rates.model), *([] if network is None else [(network, rates.network)])]
        self.to(torch.device("cpu"))

    def to(self, device: torch.device) -> Self:
        """Itself, before the first step, on a device."""
        self._capture.to(device)
        groups = [{"params": list(module.parameters()), "lr": rate} for module, rate in self._learners]
        self._optimiser = torch.optim.Adam(groups, betas=MODEL_BETAS)
        return self

    def expose(self, samples: Sequence[Sample]) -> None:
        """Nothing to choose: a model has a brightness of its own."""

    def step(self, sample: Sample, progress: float) -> dict[str, float]:
        """One step on the error of a capture. The rates fall to zero along half a cosine in every round, of which
        ``progress`` is done."""
        for group, (_, rate) in zip(self._optimiser.param_groups, self._learners, strict=True):
            group["lr"] = cosine_decay(rate, progress)
        loss = self.error(self._capture(sample.phase, sample.light), sample.capture)
        self._optimiser.zero_grad()
        loss.backward()
        self._optimiser.step()
        return {self.LOSS: float(loss.detach())}

    def error(self, predicted: Tensor, capture: Tensor) -> Tensor:
        """The absolute error of a capture ``(C, h, w)``, relative to its brightness."""
        return functional.l1_loss(predicted, capture) / capture.mean()

    def image(self, light: Tensor) -> Image:
        """The display with the parameters as they are now, held."""
        held = copy.deepcopy(self._capture).requires_grad_(False)
        return lambda phase: held(phase, light)

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
        with refuse_other_weights():
            self.model.load_state_dict(weights["model"])
            if self.network is not None:
                self.network.load_state_dict(weights["network"])
