"""HIL with two inventions of this project, neither of them in the paper: a smooth start and a search for its offset."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor
from torch.nn import functional

from ...core.errors import UserError
from ...display.metered import MeteredDisplay
from ...display.training import TrainingBench
from ..common import Bench, matched
from ..learned.retrieval import PhaseRetrieval
from ..wirtinger import Wirtinger
from .hil import HIL

TRIED_IMAGES = 4


@dataclass(frozen=True)
class SmoothStart(Wirtinger):
    """Wirtinger holography that stops, colour by colour, at a given error of the ideal picture.

    On the way to convergence a phase fills with wraps, which a display with crosstalk and a look-up table of its own
    spoils, so that the last digits of the ideal picture cost more in the captured one than they bring. How many
    iterations a picture can do without depends on it: a bright, busy one few, a dark one with a few lights many, and
    what is left there is light where none should be. Hence a tolerance, as in the discrepancy principle of iterative
    regularisation (Morozov 1966), in place of a number of iterations.

    Not in the paper. The other parameters are those of `Wirtinger`.

    Parameters
    ----------
    tolerance : float
        Squared error of the intensity over the target's squared intensity; 0: all iterations are made.
    constant : float
        Phase [rad] that is added in the end.
    """

    tolerance: Annotated[float, Interval(ge=0, le=1)] = 0.0
    constant: float = 0.0

    def __post_init__(self) -> None:
        if self.tolerance and (self.optimiser, self.loss) != ("adam", "intensity_l2"):
            raise UserError(
                "start: a tolerance is of the loss intensity_l2 and needs the optimiser adam; or set it to 0"
            )

    def solve(self, target: Tensor, bench: Bench) -> Tensor:
        """Linear intensity ``(B, C, h, w)`` to phase ``(B, C, H, W)`` [rad]; each image has its own last iteration."""
        descent = replace(self, constant=0.0)
        return torch.cat([Wirtinger.solve(descent, image[None], bench) for image in target]) + self.constant

    def _done(self, loss: Tensor) -> bool:
        return self.tolerance > 0 and bool((loss <= self.tolerance).all())


@dataclass(frozen=True)
class HILTuned(HIL):
    """HIL from a Wirtinger phase that is stopped early, and moved by a constant that was chosen with captures.

    The other parameters are those of `hil`.

    Parameters
    ----------
    retrieval : PhaseRetrieval
        Of every hologram, through what was learned: Eq. 22, nearer to the start than in `hil`.
    start : SmoothStart
        Where Algorithm 1 and every retrieval begin. Of the tolerances 0.2, 0.1, 0.04 and 0.02 the default was best on
        captures of dead leaves, and within 0.3 dB of the best on darkened ones (their cube).
    offsets : int
        Constant phases that are tried on the display for the start, evenly over 2 pi, with captures of the first
        training images, which are counted; the one of the least error is kept. An ideal image does not depend on it,
        and so nor does the network's input, but unmodulated light interferes with the image.
    """

    title: ClassVar[str] = "hardware in the loop, tuned start"
    tuned: ClassVar[str] = "the start was chosen on captures of generated images, for a reason that came from Table 3"

    retrieval: PhaseRetrieval = PhaseRetrieval()
    start: SmoothStart = SmoothStart(tolerance=0.1)
    offsets: Annotated[int, Interval(ge=1, le=64)] = 8

    def prepare(self, bench: TrainingBench) -> Mapping[str, Any]:
        """Search the constant phase [rad], kept as ``offset``, then train as `HIL.prepare`; errors as there."""
        offset = best_offset(bench, self.start, self.offsets)
        return {**HIL.prepare(self._moved(offset), bench), "offset": offset}

    def solve(self, target: Tensor, bench: MeteredDisplay) -> Tensor:
        """Linear intensity ``(B, C, h, w)`` to phase ``(B, C, H, W)`` [rad]; errors as in `HIL.solve`."""
        return HIL.solve(self._moved(bench.learned["offset"]), target, bench)

    def _moved(self, offset: float) -> HILTuned:
        return replace(self, start=replace(self.start, constant=offset))


def best_offset(bench: TrainingBench, start: Wirtinger, offsets: int) -> float:
    """That of so many constants [rad], evenly over 2 pi, whose captures are closest to the first training images.

    It does not change an ideal image. On a display it decides where the phase wraps and how the image interferes with
    the light that the panel does not modulate (Chakravarthula et al. 2020, Eq. 5 and 13). Zero without a capture if
    there is one alone.
    """
    tried = [math.tau * index / offsets for index in range(offsets)]
    if len(tried) == 1:
        return 0.0

    def search() -> dict[str, list[float]]:
        images = bench.images[:TRIED_IMAGES]
        phases = [bench.solved(start, image) for image in images]
        candidates = [
            (phase + offset, image, ("offset", index))
            for image, phase in zip(images, phases, strict=True)
            for index, offset in enumerate(tried)
        ]
        bench.announce(candidates)
        errors = [0.0] * offsets
        for phase, image, (name, index) in candidates:
            capture = bench.photograph(phase, image, name, index)
            errors[index] += float(functional.mse_loss(matched(capture, image.target), image.target))
        return {"errors": errors}

    errors = bench.kept("offset", search)["errors"]
    return tried[errors.index(min(errors))]
