"""A frozen network as a display (paper 6.3): what it predicts of a phase is its capture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import torch
from torch import Tensor

from ..core.device import CPU
from ..core.errors import CellError
from .api import Camera, Capture, DisplaySpec, Exposure, RectifiedCapture, Simulation, efficiency, white_irradiance
from .metered import MeteredDisplay, MethodHandles
from .phases import check_phase, from_numpy


class Predictor(Protocol):
    """A trained method that predicts captures."""

    def predict(self, phase: Tensor, bench: MeteredDisplay) -> Tensor:
        """Phase ``(B, C, H, W)`` [rad] to the capture ``(B, C, h, w)``, in the unit of ``RectifiedCapture``."""


@dataclass(frozen=True)
class LearnedBench(MethodHandles):
    """A display without noise or registration; ``method`` predicts on ``device`` with what it ``learned``."""

    spec: DisplaySpec
    method: Predictor
    learned: Mapping[str, Any]
    seed: int
    device: torch.device = CPU

    @property
    def simulation(self) -> Simulation:
        """There is none: only a simulated bench can be looked into."""
        raise CellError("a learned display has no simulated bench to look into")

    @torch.no_grad()
    def photograph(
        self, phase: Tensor, target: Tensor, item: str, repeat: int, exposure: Exposure = "equal", label: str = ""
    ) -> RectifiedCapture:
        """The predicted capture of ``phase`` ``(C, H, W)`` [rad]; the exposure does not matter without noise."""
        check_phase(phase, self.spec, label)
        if phase.ndim == 4:
            raise CellError(f"{label}: a trained network predicts one frame, got {len(phase)}")
        handle = MeteredDisplay(self, label, target.to(self.device), (self.seed, item, repeat), learned=self.learned)
        image = from_numpy(self.method.predict(phase[None].to(self.device), handle))[0].detach().cpu()
        light = tuple(white_irradiance(target, self.spec).tolist())
        capture = Capture(image, dark=0.0, white=float("inf"), gain=(1.0,) * len(image))
        return RectifiedCapture(
            image, capture, saturated=0.0, efficiency=efficiency(image, target), residual=0.0, exposure=light
        )

    def session(self, names: tuple[object, ...], target: Tensor) -> Camera:
        """A camera that sees what is predicted, without noise, so that nothing depends on ``names``."""
        return LearnedCamera(self, target)

    def rectified(self, capture: Capture, target: Tensor) -> Tensor:
        """A predicted capture is in the target's frame already."""
        return capture.linear()


@dataclass(frozen=True)
class LearnedCamera:
    """The camera of a learned display, exposed for a target ``(C, h, w)``."""

    display: LearnedBench
    target: Tensor

    def announce(self, phases: Sequence[Tensor]) -> None:
        """Nothing: a network is always ready."""

    def capture(self, phase: Tensor) -> Capture:
        """The predicted capture of ``phase`` ``(C, H, W)`` [rad]."""
        return self.display.photograph(phase, self.target, "camera", 0).capture
