"""The holograms that a display's camera is registered with."""

from __future__ import annotations

from torch import Tensor

from ..display.api import Display
from ..display.metered import MeteredDisplay
from ..optics.phase import TAU
from .wirtinger import Wirtinger

HOLOGRAMS, STEPS = 4, 4


def fiducial_phases(display: Display, target: Tensor) -> dict[tuple[int, int], Tensor]:
    """Phases ``(C, H, W)`` [rad] of the grid ``target`` ``(C, h, w)``, by hologram and phase step.

    They start at random, because a smoothly curved image phase turns a little defocus into a change of scale, and each
    is shown with several constant phases added, because unmodulated light interferes with the image and the mean over
    the steps cancels that; both then also average speckle.
    """
    phases: dict[tuple[int, int], Tensor] = {}
    for hologram in range(HOLOGRAMS):
        handle = MeteredDisplay(display, "fiducial", target, (display.seed, "fiducial", hologram))
        phase = Wirtinger(iterations=30, initial_phase="random").solve(target[None], handle)[0]
        phases |= {(hologram, step): phase + step * TAU / STEPS for step in range(STEPS)}
    return phases
