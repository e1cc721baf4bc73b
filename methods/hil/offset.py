"""The constant phase of a hologram, searched with captures. Not in the paper.

It does not change an ideal image. On a display it decides where the phase wraps and how the image interferes with the
light that the panel does not modulate (Chakravarthula et al. 2020, Eq. 5 and 13).
"""

from __future__ import annotations

import math

from torch.nn import functional

from ...display.training import TrainingBench
from ..common import matched
from ..wirtinger import Wirtinger

TRIED_IMAGES = 4


def best_offset(bench: TrainingBench, start: Wirtinger, offsets: int) -> float:
    """That of so many constants [rad], evenly over 2 pi, whose captures are closest to the first training images.

    Zero without a capture if there is one alone.
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
