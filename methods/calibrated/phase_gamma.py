"""A gamma on the phase of open-loop holograms, found with captures of the display.

Chakravarthula et al. 2020, Section 7: "holograms for other methods needed an extra gamma correction to the phase
patterns, before displaying on the hardware, for improved performance on our aged SLM with inaccurate look-up-tables,
aiming for best hand-tuned display outputs". The search below stands in the place of the hand.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor
from torch.nn import functional

from ...display.api import DisplaySpec
from ...display.metered import MeteredDisplay, Solver
from ...display.training import TrainingBench
from ...optics.phase import TAU, blaze, wrap
from ..common import matched
from ..double_phase import DoublePhase
from ..wirtinger import Wirtinger

COARSE = tuple(2 ** (step / 4) for step in range(-4, 5))  # 0.5 to 2, and 1 among them
FINE = tuple(2 ** (step / 12) for step in (-2, -1, 1, 2))  # times the best: steps of 6 %


@dataclass(frozen=True)
class PhaseGamma(ABC):
    """An open-loop method whose pattern on the panel, a phase in [0, 2 pi), becomes 2 pi (phase / 2 pi)^gamma.

    There is one gamma for all colours of a display, as the paper says of no more. It is the one whose captures of
    training images, of all `COARSE` and then of all `FINE` around the best of them, have the least squared error: with
    the default, 39 captures.

    Parameters
    ----------
    images : int
        How many training images are captured, the first ones, 13 times each.
    """

    images: Annotated[int, Interval(ge=1, le=100)] = 3

    trains: ClassVar[bool] = True

    @property
    @abstractmethod
    def of(self) -> Solver:
        """The open-loop method: a parameter of every subclass."""

    def prepare(self, bench: TrainingBench) -> Mapping[str, Any]:
        """Find the gamma.

        Parameters
        ----------
        bench : TrainingBench
            The display, the training images, and a memory that survives a kill.

        Returns
        -------
        mapping
            ``gamma``.

        Raises
        ------
        BudgetError
            When no capture is left.
        """
        phases = [bench.solved(self.of, image) for image in bench.images[: self.images]]
        coarse = self._errors(bench, 1, phases, COARSE)
        best = min(coarse, key=coarse.__getitem__)
        errors = coarse | self._errors(bench, 2, phases, [best * factor for factor in FINE])
        return {"gamma": min(errors, key=errors.__getitem__)}

    def _errors(
        self, bench: TrainingBench, search: int, phases: Sequence[Tensor], gammas: Sequence[float]
    ) -> dict[float, float]:
        """Mean squared error of the captures at each gamma, every search kept as a whole."""

        pairs = list(zip(bench.images, phases, strict=False))

        def capture() -> dict[str, list[float]]:
            shots = [
                [(corrected(phase, gamma, bench.spec), image, ("gamma", f"{gamma:.6f}")) for image, phase in pairs]
                for gamma in gammas
            ]
            bench.announce(shot for group in shots for shot in group)
            errors = []
            for step, (gamma, group) in enumerate(zip(gammas, shots, strict=True)):
                images = [
                    matched(bench.photograph(phase, image, *names), image.target) for phase, image, names in group
                ]
                losses = map(functional.mse_loss, images, (image.target for _, image, _ in group))
                errors.append(float(torch.stack(list(losses)).mean()))
                bench.log(round=search, step=step, gamma=gamma, error=errors[-1])
            return {"errors": errors}

        return dict(zip(gammas, bench.kept(f"search {search}", capture)["errors"], strict=True))

    def solve(self, target: Tensor, bench: MeteredDisplay) -> Tensor:
        """Phases ``(B, C, H, W)`` [rad] of the open-loop method, with the display's gamma.

        target: linear intensity ``(B, C, h, w)`` in [0, 1]. CellError: it was not trained.
        """
        return corrected(bench.solved(self.of, target), bench.learned["gamma"], bench.spec)


def corrected(phase: Tensor, gamma: float, spec: DisplaySpec) -> Tensor:
    """A phase ``(..., H, W)`` [rad] whose pattern on the panel, which has the blaze of the display, is `curved`."""
    ramp = blaze(spec.shape, spec.blaze, device=phase.device)
    return curved(phase + ramp, gamma) - ramp


def curved(phase: Tensor, gamma: float) -> Tensor:
    """A phase [rad], wrapped to [0, 2 pi), as 2 pi (phase / 2 pi)^gamma.

    Examples
    --------
    >>> curved(torch.tensor([0.0, torch.pi, 3 * torch.pi]), 2.0) / torch.pi
    tensor([0.0000, 0.5000, 0.5000])
    """
    return TAU * (wrap(phase) / TAU) ** gamma


@dataclass(frozen=True)
class WirtingerGamma(PhaseGamma):
    """Wirtinger holography with a gamma on its phase, found with captures of the display.

    A phase in [0, 2 pi) becomes 2 pi (phase / 2 pi)^gamma, with one gamma for all colours: of 13, the one whose
    captures of training images have the least squared error.

    Parameters
    ----------
    of : Wirtinger
        Wirtinger holography.
    """

    of: Wirtinger = Wirtinger()

    title: ClassVar[str] = "Wirtinger holography through a phase gamma"


@dataclass(frozen=True)
class DoublePhaseGamma(PhaseGamma):
    """Double phase with a gamma on its phase, found with captures of the display.

    A phase in [0, 2 pi) becomes 2 pi (phase / 2 pi)^gamma, with one gamma for all colours: of 13, the one whose
    captures of training images have the least squared error.

    Parameters
    ----------
    of : DoublePhase
        Double phase.
    """

    of: DoublePhase = DoublePhase()

    title: ClassVar[str] = "double-phase encoding through a phase gamma"
    fresnel: ClassVar[bool] = True
