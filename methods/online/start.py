"""Where optimisation with the camera begins, what it keeps and how it ends: all by captured errors, colour by colour.

A captured error is one draw of the camera's noise. The least of many is lucky as well as good, so what is kept in the
end is decided between few holograms with fresh frames.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor

from ...display.metered import MeteredDisplay
from ..common import matched
from ..descent import Best
from ..wirtinger import Wirtinger

# Neither the search for a start nor the decision at the end takes more than one capture in so many.
LEAST_SHARE = 4


def captured_error(capture: Tensor, target: Tensor) -> Tensor:
    """Mean squared error ``(C,)`` of a capture ``(C, h, w)``, matched in brightness and clipped as it is scored."""
    return (matched(capture, target).clamp(0, 1) - target).square().mean((-2, -1))


class Camera:
    """The captures of one image, of which each may improve the hologram that is kept.

    target: ``(C, h, w)`` linear light. fallback: ``(C, H, W)`` [rad], kept until a capture shows a better one.
    captures: the most to take in all. The bench always knows the hologram of the least captured error so far, so that
    the display may end the solution at any moment.
    """

    def __init__(self, bench: MeteredDisplay, target: Tensor, fallback: Tensor, captures: int) -> None:
        self.left = captures
        self._bench, self._target = bench, target
        self._best = Best(fallback)
        bench.keep(fallback)

    @property
    def best(self) -> Tensor:
        """The phase ``(C, H, W)`` [rad] of the least captured error so far, which may be a lucky one."""
        return self._best.phase

    def show(self, phase: Tensor, frames: int = 1) -> Tensor:
        """The mean of so many captures of a phase ``(C, H, W)`` [rad], ``(C, h, w)`` linear light."""
        self.announce([phase] * frames)
        capture = torch.stack([self._frame(phase) for _ in range(frames)]).mean(0)
        error = captured_error(capture, self._target)
        if bool((error < self._best.loss).any()):
            self._best.update(error, phase)
            self._bench.keep(self._best.phase)
        return capture

    def settle(self, phases: Sequence[Tensor], frames: int) -> Tensor:
        """The phase ``(C, H, W)`` of least mean error in ``frames`` new captures of each; fewer where fewer are left.

        Without a capture for each it is the best so far.
        """
        errors = self._target.new_zeros(len(phases), len(self._target))
        rounds = min(frames, self.left // len(phases))
        self.announce([*phases] * rounds)
        for _ in range(rounds):
            errors += torch.stack([captured_error(self._frame(phase), self._target) for phase in phases])
        if not rounds:
            return self.best.clone()
        chosen = errors.argmin(0).tolist()
        settled = torch.stack([phases[index][colour] for colour, index in enumerate(chosen)])
        self._bench.keep(settled)
        return settled

    def announce(self, phases: Sequence[Tensor]) -> None:
        """Tell the bench which phases ``(C, H, W)`` [rad] are captured next."""
        self._bench.announce([phase.detach() for phase in phases])

    def _frame(self, phase: Tensor) -> Tensor:
        capture = self._bench.rectify(self._bench.capture(phase.detach()))
        self.left -= 1
        return capture


@dataclass(frozen=True)
class CameraStart:
    """Holograms that are tried on the display, of which the one with the least captured error goes on.

    Not in the paper. A panel blurs the wraps of a converged phase, and unmodulated light interferes with the image
    (Chakravarthula et al. 2020, Eq. 5 and 13), neither of which an ideal image depends on.

    Parameters
    ----------
    converged : Wirtinger
        Wirtinger holography.
    early : Wirtinger
        The same, stopped early.
    offsets : int
        Constant phases, evenly over 2 pi, that are added to the early one.
    """

    converged: Wirtinger = Wirtinger()
    early: Wirtinger = Wirtinger(iterations=8)
    offsets: Annotated[int, Interval(ge=1, le=64)] = 8

    def nominal(self, target: Tensor, bench: MeteredDisplay) -> Tensor:
        """The converged hologram ``(C, H, W)`` [rad] of a target ``(C, h, w)``, made without a capture."""
        return bench.solved(self.converged, target[None])[0]

    def search(self, target: Tensor, bench: MeteredDisplay, camera: Camera, nominal: Tensor) -> Tensor:
        """Show the candidates, the converged one first; the best of each colour, ``(C, H, W)`` [rad]."""
        offsets = min(self.offsets, camera.left // LEAST_SHARE - 1)
        tried = [nominal] if offsets >= 0 else []
        if offsets > 0:
            early = bench.solved(self.early, target[None])[0]
            tried += [early + math.tau * index / offsets for index in range(offsets)]
        camera.announce(tried)
        for phase in tried:
            camera.show(phase)
        return camera.best.clone()


def allowed(captures: int, bench: MeteredDisplay, images: int) -> int:
    """Captures for each of so many images: as many as the method wants, within what the display allows for all."""
    return captures if bench.budget is None else min(captures, bench.budget // images)


@dataclass(frozen=True)
class OnlineLoop(ABC):
    """Optimisation of each image with the camera, from the best of some starts to a decision by new captures.

    Parameters
    ----------
    captures : int
        In all, for the search of a start, the optimisation and the decision at the end.
    start : CameraStart
        Not in the paper: the holograms that are tried first.
    checks : int
        Not in the paper: new captures in the end of each of the converged Wirtinger hologram, the one of the least
        captured error and the last, between which they decide.
    """

    captures: Annotated[int, Interval(ge=1, le=100_000)] = 200
    start: CameraStart = CameraStart()
    checks: Annotated[int, Interval(ge=1, le=100)] = 3

    camera: ClassVar[bool] = True
    version: ClassVar[int] = 2

    def solve(self, target: Tensor, bench: MeteredDisplay) -> Tensor:
        """Phases ``(B, C, H, W)`` [rad] of least captured error.

        target: linear intensity ``(B, C, h, w)`` in [0, 1]. CellError: without a camera.
        """
        pairs = enumerate(target)
        return torch.stack([self._solved(image, bench, len(target), index) for index, image in pairs])

    def _solved(self, target: Tensor, bench: MeteredDisplay, images: int, index: int) -> Tensor:
        """One image: target ``(C, h, w)`` to phase ``(C, H, W)``."""
        nominal = self.start.nominal(target, bench)
        camera = Camera(bench, target, nominal, allowed(self.captures, bench, images))
        checks = min(self.checks, camera.left // (3 * LEAST_SHARE))
        start = self.start.search(target, bench, camera, nominal)
        phase = self._optimise(start, target, bench, camera, 3 * checks, index)
        return camera.settle([nominal, camera.best, phase], checks) if checks else camera.best

    @abstractmethod
    def _optimise(
        self, phase: Tensor, target: Tensor, bench: MeteredDisplay, camera: Camera, kept: int, index: int
    ) -> Tensor:
        """The last phase on the way from a start, both ``(C, H, W)`` [rad]. kept: captures that the decision takes;
        index: of the image."""
