"""A network that gives the phase of a hologram in one pass, trained through a model of the display."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import torch
from annotated_types import Interval
from torch import Tensor, nn

from ...display.api import DisplaySpec
from ...display.metered import MeteredDisplay
from ...display.nominal import ideal_image, nominal_levels
from ...display.training import TrainingBench
from ..calibrated.approximator import PredictedCapture
from ..calibrated.parametric import ParametricModel
from ..common import Offset, with_offset
from ..learned.samples import Steps
from ..learned.weights import refuse_other_weights, seeded
from .training import train

# Phase (C, H, W) [rad] and the light (C,) of a white pixel to the expected picture (C, h, w).
Show = Callable[[Tensor, Tensor], Tensor]
WIDTH = Interval(ge=1, le=256)


@dataclass(frozen=True)
class OnePass(ABC):
    """A network from the amplitude of a target to the phase of its hologram; a subclass gives the network. SI units.

    It is trained without holograms to copy: a model of the display shows its phase of a training image, and the loss is
    the squared error of the amplitude at the best brightness, ``losses.amplitude_l2``. One network serves all colours
    of a display, and is told the colour.

    Parameters
    ----------
    through : {"ideal", "parametric_model"}
        What shows the phase in training. ideal: the nominal optics, without a photograph; parametric_model: the display
        as that method learns it from photographs, then held.
    steps : int
        Of Adam, an image each.
    rate : float
        Its first rate, which falls to zero along half a cosine.
    seed : int
        Of the first weights.
    calibration : ParametricModel
        How the display is learned, where ``through`` asks for it.
    offset : {"none", "centre"}
        Constant phase that is added in the end. none: zero; centre: the one that brings the phase of the fewest pixels
        to the wrap between 0 and 2 pi, whose edges a panel blurs. A network trained through a display that was
        photographed learns its own.
    """

    through: Literal["ideal", "parametric_model"] = "ideal"
    steps: Steps = 1000
    rate: Annotated[float, Interval(gt=0, le=1)] = 2e-3
    seed: int = 0
    calibration: ParametricModel = ParametricModel()
    offset: Offset = "centre"

    trains: ClassVar[bool] = True

    def external(self) -> dict[str, Path | None]:
        """Files that the calibration takes where a machine has them, by what they hold; None for one not there."""
        return self.calibration.external() if self.through != "ideal" else {}

    def blind(self) -> bool:
        """Whether the training takes no photograph."""
        return self.through == "ideal"

    @abstractmethod
    def network(self, spec: DisplaySpec) -> nn.Module:
        """Amplitude ``(C, H, W)`` at the image plane, zero around the region, to phase ``(C, H, W)`` [rad]; untrained.

        Its weights come from torch's global random numbers.
        """

    def prepare(self, bench: TrainingBench) -> Mapping[str, Any]:
        """Learn the display where ``through`` asks for it, then train the network through it.

        Parameters
        ----------
        bench : TrainingBench
            The display, the training images, and a memory that survives a kill.

        Returns
        -------
        mapping
            ``network``, its weights.

        Raises
        ------
        BudgetError
            When no capture is left for the calibration.
        """
        show, network = self._show(bench), self._fresh(bench)
        number = 1 if self.through == "ideal" else self.calibration.training.rounds + 1
        train(network, partial(self._phase, network, bench.spec), show, bench, self.steps, self.rate, number)
        return {"network": network.state_dict()}

    def solve(self, target: Tensor, bench: MeteredDisplay) -> Tensor:
        """Phases ``(B, C, H, W)`` [rad] by one pass of the network.

        target: linear intensity ``(B, C, h, w)`` in [0, 1]. CellError: it was not trained; UserError: what was learned
        are the weights of another network.
        """
        network = self._fresh(bench)
        with refuse_other_weights():
            network.load_state_dict(bench.learned["network"])
        with torch.no_grad():
            phases = torch.stack([self._phase(network, bench.spec, image) for image in target])
        return with_offset(phases, self.offset) if self.through == "ideal" else phases

    def _fresh(self, bench: TrainingBench | MeteredDisplay) -> nn.Module:
        with seeded("one-pass network", self.seed):
            return self.network(bench.spec).to(bench.device)

    def _phase(self, network: nn.Module, spec: DisplaySpec, target: Tensor) -> Tensor:
        """Linear intensity ``(C, h, w)`` to phase ``(C, H, W)`` [rad]."""
        phase: Tensor = network(spec.region.embed(target.clamp_min(0).sqrt(), spec.shape))
        return phase

    def _show(self, bench: TrainingBench) -> Show:
        if self.through == "ideal":
            return lambda phase, light: ideal_image(nominal_levels(phase, bench.spec), bench.spec)
        display = self.calibration.approximator(bench.spec).to(bench.device)
        display.load_learned(self.calibration.prepare(bench))
        return PredictedCapture(display.model, display.network, display.terms).requires_grad_(False)
