"""HIL with the aberration field of Eq. 13 kept as a field: a physical model of the display learns from the captures.

It departs from Chakravarthula et al. 2020 where the captures say that its form loses most: the paper's network sees the
ideal intensity alone, and intensity does not tell how the aberration field interferes (Eq. 13, cos(Delta theta)) nor
what a look-up table does to a wrap. Captures, rounds and retrieval are those of ``hil``.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor, nn
from torch.nn import functional

from ... import seeds
from ...errors import UserError
from ...optics.phasor import squared_modulus
from ..descent import cosine_decay
from ..display_model import DisplayModel
from ..wirtinger import Wirtinger
from .loop import Rounds, Sample, train_in_the_loop
from .networks import Network
from .objective import load_moments
from .retrieval import Image, SquaredErrorRetrieval, check_region, retrieve

if TYPE_CHECKING:
    from ...display.contract import DisplaySpec
    from ...display.training import TrainingBench, TrainingImage
    from ...display.workbench import MeteredBench

MODEL_RATE, NETWORK_RATE = 1e-2, 3e-4
BETAS = (0.9, 0.99)


class PlusApproximator:
    """|field of the display model|^2 and, if there is a network, what it adds; both learn from the same captures.

    The network sees intensity, real and imaginary part of every colour and adds to the intensity; its last layer starts
    at zero, so the physics is learned first and the network learns what it leaves.
    """

    def __init__(self, spec: DisplaySpec, network: Network | None, seed: int) -> None:
        if network is not None and (network.dropout or network.name == "pix2pix"):
            raise UserError(
                "hil_plus: a residual network has no dropout, whose random numbers a resumed training lacks"
            )
        channels = len(spec.wavelengths)
        self.model = DisplayModel(spec)
        with torch.random.fork_rng(devices=[]):
            torch.set_rng_state(seeds.generator("residual network", seed).get_state())
            self.network = None if network is None else network.generator(3 * channels, channels)
        groups: list[dict[str, Any]] = [{"params": list(self.model.parameters()), "lr": MODEL_RATE}]
        if self.network is not None:
            last = [one for one in self.network.modules() if isinstance(one, nn.Conv2d | nn.ConvTranspose2d)][-1]
            nn.init.zeros_(last.weight)
            groups.append({"params": list(self.network.parameters()), "lr": NETWORK_RATE})
        self._optimiser = torch.optim.Adam(groups, betas=BETAS)
        self._rates = [group["lr"] for group in groups]

    def expose(self, samples: Sequence[Sample]) -> None:
        """Nothing to choose: the model has a brightness of its own."""

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


def predicted_capture(model: DisplayModel, network: nn.Module | None, phase: Tensor, light: Tensor) -> Tensor:
    """Phase ``(C, H, W)`` [rad] to the capture ``(C, h, w)`` in the unit of ``light`` ``(C,)``."""
    field = model(phase) / light.sqrt()[:, None, None]
    intensity = squared_modulus(field)
    if network is None:
        return intensity
    return intensity + network(torch.cat([intensity, field.real, field.imag])[None])[0]


@dataclass(frozen=True)
class FieldRetrieval(SquaredErrorRetrieval):
    """More and larger steps than through a network: the model stays right far from where it was trained."""

    iterations: Annotated[int, Interval(ge=0, le=100_000)] = 100
    step: Annotated[float, Interval(gt=0, le=10)] = 0.05


@dataclass(frozen=True)
class HILPlus:
    """Hardware in the loop with the aberration field as a field; see this file's first lines.

    network: a generator that adds to what the display model predicts; none by default, since it gained nothing on
    held-out images (22.09 dB without, 21.90 dB with it after a first round of 64 captures). training: Algorithm 1.
    retrieval: Eq. 22, of which the squared error alone is used. start: Wirtinger holography, stopped while its phase is
    still smooth: a converged phase is full of wraps that descent does not get out of. seed: of the network's weights.
    """

    network: Network | None = None
    training: Rounds = Rounds()
    retrieval: FieldRetrieval = FieldRetrieval()
    start: Wirtinger = Wirtinger(iterations=5)
    seed: int = 0

    camera: ClassVar[bool] = False
    privileged: ClassVar[bool] = False
    trains: ClassVar[bool] = True
    version: ClassVar[int] = 1

    def prepare(self, bench: TrainingBench) -> Mapping[str, Any]:
        """Learn the display from captures; what ``solve`` and ``predict`` need of it."""
        check_region(bench.spec.region.shape, self.retrieval)
        approximator = PlusApproximator(bench.spec, self.network, self.seed)

        def begin(image: TrainingImage) -> Tensor:
            return self.start.solve(image.target[None], bench)[0]

        def search(display: Image, target: Tensor, phase: Tensor) -> Tensor:
            return retrieve(display, target, phase, self.retrieval)

        train_in_the_loop(bench, approximator, begin, search, self.training)
        return approximator.learned()

    def solve(self, target: Tensor, bench: MeteredBench) -> Tensor:
        """Linear intensity ``(B, C, h, w)`` to phase ``(B, C, H, W)`` [rad]."""
        display, start = self._display(bench), self.start.solve(target, bench)
        pairs = zip(target, start, strict=True)
        return torch.stack([retrieve(display, image, phase, self.retrieval) for image, phase in pairs])

    @torch.no_grad()
    def predict(self, phase: Tensor, bench: MeteredBench) -> Tensor:
        """Phase ``(B, C, H, W)`` [rad] to the capture ``(B, C, h, w)`` that was learned to follow."""
        display = self._display(bench)
        return torch.stack([display(one) for one in phase])

    def _display(self, bench: MeteredBench) -> Image:
        approximator = PlusApproximator(bench.spec, self.network, self.seed)
        approximator.load_learned(bench.learned)
        return approximator.image(bench.light)
