"""HIL with two inventions of this project, neither of them in the paper: a smooth start and a search for its offset."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

from annotated_types import Interval
from torch import Tensor

from ...display.metered import MeteredDisplay
from ...display.training import TrainingBench
from ..learned.retrieval import PhaseRetrieval
from .hil import HIL
from .offset import best_offset
from .start import SmoothStart


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
