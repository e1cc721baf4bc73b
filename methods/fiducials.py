"""The holograms that a display's camera is registered with."""

from __future__ import annotations

import hashlib
from dataclasses import replace

from torch import Tensor

from ..display.api import Display
from ..display.metered import MeteredDisplay
from ..optics.phase import TAU
from .coarse.gumbel import Gumbel
from .wirtinger import Wirtinger

HOLOGRAMS, STEPS = 4, 4


def fiducial_phases(display: Display, target: Tensor) -> dict[tuple[int, int], Tensor]:
    """Phases ``(C, H, W)`` [rad] of the grid ``target`` ``(C, h, w)``, by hologram and phase step.

    They start at random, because a smoothly curved image phase turns a little defocus into a change of scale, and each
    is shown with several constant phases added, because unmodulated light interferes with the image and the mean over
    the steps cancels that; both then also average speckle. A panel of two levels has two steps, and other holograms.
    """
    steps = min(STEPS, 2**display.spec.bits)
    # They depend on the nominal optics alone, which displays of a study and most changes to one have in common.
    shown = hashlib.sha256(target.cpu().numpy().tobytes()).hexdigest()
    key = (replace(display.spec, name=""), display.seed, target.device, shown)
    if key not in _solved:
        _solved.clear()
        _solved[key] = [_hologram(display, target, number) for number in range(HOLOGRAMS * STEPS // steps)]
    phases = enumerate(_solved[key])
    return {(number, step): phase + step * TAU / steps for number, phase in phases for step in range(steps)}


_solved: dict[object, list[Tensor]] = {}  # those of the last optics


def _hologram(display: Display, target: Tensor, number: int) -> Tensor:
    handle = MeteredDisplay(display, "fiducial", target, (display.seed, "fiducial", number))
    if display.spec.bits == 1:
        return Gumbel(iterations=40, initial_phase="random").solve(target[None], handle)[0]
    return Wirtinger(iterations=30, initial_phase="random").solve(target[None], handle)[0]
