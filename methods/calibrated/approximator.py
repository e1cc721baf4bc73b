"""Any differentiable model of a display, and how it learns from captures."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self, cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from ...optics.phasor import squared_modulus
from ..descent import cosine_decay
from ..learned.retrieval import Image
from ..learned.samples import Approximator, Sample
from ..learned.weights import load_moments, refuse_other_weights
from .terms import Haze

MODEL_BETAS = (0.9, 0.99)


@dataclass(frozen=True)
class Rates:
    """Adam's first rate in every round, of the model, of the network that adds to it and of the terms between."""

    model: float
    network: float = 3e-4
    terms: float = 3e-2


class PredictedCapture(nn.Module):
    """What a model makes of a phase, what becomes of its intensity, and what a network adds in the end.

    model: phase ``(C, H, W)`` [rad] to the field (complex) or the intensity (real) where the light on the panel is 1:
    in the region, ``(C, h, w)``, or by ``over_panel``, ``(C, H, W)``, where there are terms, which give the capture of
    the region. network: what the terms give, the intensity and, of a field, its real and imaginary part,
    ``(1, inputs C, h, w)``, to what is added to the capture; it needs terms.
    """

    def __init__(self, model: nn.Module, network: nn.Module | None, terms: Haze | None = None) -> None:
        super().__init__()
        self.model, self.network, self.terms = model, network, terms

    def forward(self, phase: Tensor, light: Tensor) -> Tensor:
        """Phase ``(C, H, W)`` [rad] to the capture ``(C, h, w)`` in the unit of ``light`` ``(C,)``."""
        white = light[:, None, None]
        show = self.model if self.terms is None else cast(Callable[[Tensor], Tensor], self.model.over_panel)
        output: Tensor = show(phase)
        if output.is_complex():
            output = output / white.sqrt()
            seen = [squared_modulus(output), output.real, output.imag]
        else:
            seen = [output / white]
        if self.terms is None:
            return seen[0]
        capture: Tensor = self.terms(seen[0])
        if self.network is None:
            return capture
        added: Tensor = self.network(torch.cat([capture, *map(self.terms.region.crop, seen)])[None])[0]
        return capture + added


class ModelApproximator(Approximator):
    """A model of the display, terms and a network, see ``PredictedCapture``; all learn from one loss."""

    LOSS: ClassVar[str] = "l1"

    def __init__(self, model: nn.Module, network: nn.Module | None, rates: Rates, terms: Haze | None = None) -> None:
        self.model, self.network, self.terms = model, network, terms
        self._capture = PredictedCapture(model, network, terms)
        given = ((model, rates.model), (network, rates.network), (terms, rates.terms))
        self._learners = [(module, rate) for module, rate in given if module is not None]
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
        return {name: None if module is None else module.state_dict() for name, module in self._parts.items()}

    def load_learned(self, weights: Mapping[str, Any]) -> None:
        """UserError for the weights of another network."""
        with refuse_other_weights():
            for name, module in self._parts.items():
                if module is not None:
                    module.load_state_dict(weights[name])

    @property
    def _parts(self) -> dict[str, nn.Module | None]:
        terms = {} if self.terms is None else {"terms": self.terms}
        return {"model": self.model, "network": self.network, **terms}
