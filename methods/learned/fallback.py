"""The way back to plain Wirtinger holography, where a loop made held-out captures worse. Not in any of the papers.

Of a display that is as the nominal model says, a calibration learns noise. Every trained method has the switch
``fallback``, off by default, so that a row shows what its method does; where it is on and used, the report says so.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from torch import Tensor

from ...display.training import TrainingBench, TrainingImage
from ..wirtinger import Wirtinger
from .fidelity import matched_psnr
from .samples import captured

WIRTINGER = Wirtinger()


def fell_back(wanted: bool, bench: TrainingBench, solve: Callable[[TrainingImage], Tensor]) -> int:
    """1 where the switch is on and the mean PSNR of the held-out captures is below that of Wirtinger holograms, else 0.

    solve: an image to the phase ``(C, H, W)`` [rad] of the trained method. Captures are taken where the switch is on.
    """

    def quality(name: str, phases: Sequence[Tensor]) -> float:
        """Sum of the PSNR [dB] of all held-out images."""
        keys = [f"{name} {image.item}" for image in bench.held_out]
        samples = captured(bench, keys, phases, bench.held_out, name)
        return sum(matched_psnr(sample.capture, sample.target) for sample in samples)

    if not wanted:
        return 0
    learned = quality("learned", [solve(image) for image in bench.held_out])
    return int(learned < quality("nominal", [bench.solved(WIRTINGER, image) for image in bench.held_out]))
