"""Algorithm 1 of Chakravarthula et al. 2020 (Section 4.4): training the aberration approximator D.

The names are those of the paper: D, its K rounds, the training images T, their phases Phi. P is the ideal propagation,
P~ that of the display, H(Phi) the field at the panel.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from torch import Tensor

from ...display.training import TrainingBench, TrainingImage
from .checkpoint import Checkpoint
from .fidelity import fidelity
from .retrieval import Image
from .samples import Approximator, Sample, Schedule

# Display as it is approximated, target (C, h, w), start (C, H, W): the phase retrieved through it.
Minimise = Callable[[Image, Tensor, Tensor], Tensor]


def train(
    bench: TrainingBench,
    D: Approximator,
    start: Callable[[TrainingImage], Tensor],
    minimise: Minimise,
    schedule: Schedule,
    earlier: Sequence[Sample] = (),
) -> None:
    """Train an approximator in place, with a bench that may kill and resume the training at any moment.

    Parameters
    ----------
    bench : TrainingBench
        The display, the images and a memory.
    D : Approximator
        Untrained.
    start : callable
        The phase ``(C, H, W)`` [rad] of an image, where every retrieval begins. The first round shows it as it is: with
        D = Id it is the minimum already.
    minimise : callable
        Phase retrieval through D, see `Minimise`.
    schedule : Schedule
        Rounds, images and steps.
    earlier : sequence of Sample
        Not in the paper: captures that every round learns from beside its own.
    """
    checkpoint = Checkpoint(bench, D, schedule)

    def optimise(k: int, I: TrainingImage) -> Tensor:  # noqa: E741
        phase = checkpoint.kept(f"start {I.item}", lambda: start(I))
        return phase if k == 1 else minimise(D.image(bench.light(I)), I.target, phase)

    samples = list(earlier)  # D^0 = Id
    for k in checkpoint.rounds(schedule.rounds):  # for k = 1 to K do
        T = schedule.images_of(k, bench.images)
        # Optimize for each Phi_I with a fixed D: Phi^(k-1) <- minimize over Phi of D^(k-1)(|P(H(Phi))|^2) - I
        Phi = checkpoint.phases("round", k, T, partial(optimise, k))
        # Compute ideal phase hologram images: P(H(Phi^(k-1))). D does it, since a model may need the phase itself.
        # Capture real hardware aberrated images: P~(H(Phi^(k-1)))
        captures = checkpoint.captures("round", k, T, Phi)
        # The paper refines with the most recent captures alone.
        samples = [*(samples if schedule.keep_captures else earlier), *captures]
        if k == 1:
            D.expose(samples)  # not in the paper, whose captures have the unit of the targets
        # Refine D with new captures: D^k <- refine(D^(k-1), ideal images, captures)
        for sample, progress in checkpoint.steps(samples, schedule.steps_of(k)):
            checkpoint.add(D.step(sample, progress))
        if not checkpoint.passed:  # not in the paper: images that D does not learn from show how far it can be trusted
            Phi = checkpoint.phases("held out", k + 1, bench.held_out, partial(optimise, k + 1))
            unseen = checkpoint.captures("held out", k + 1, bench.held_out, Phi)
            checkpoint.watch(fidelity(D, unseen))
        if schedule.ends(checkpoint.watched):
            break
