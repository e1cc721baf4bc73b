"""Each hologram optimised with the camera: captures in the place of the simulated image, gradients of the ideal model.

Chakravarthula, Tseng, Srivastava, Fuchs & Heide, "Learned hardware-in-the-loop phase retrieval for holographic
near-eye displays", ACM Trans. Graph. 39(6), 186 (2020), Section 4.5; the camera in the loop of Peng, Choi, Padmanaban
& Wetzstein, "Neural holography with camera-in-the-loop training", ACM Trans. Graph. 39(6), 185 (2020).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor

from ...display.api import DisplaySpec
from ...display.metered import MeteredDisplay
from ...metrics.base import gaussian_blur
from ..common import matched, unit_field
from ..descent import cosine_decay
from .start import Camera, OnlineLoop

# Adam's decay rates. Little momentum: the gradient is that of another display.
MOMENTS = (0.6, 0.99)


@dataclass(frozen=True)
class OnlineCamera(OnlineLoop):
    """Adam on the phase for the captured intensity in the region, all colours in one capture.

    On an ideal display, and without smoothing, this is Wirtinger holography with more iterations. Chakravarthula et al.
    2020, Section 4.5; SI units throughout.

    Parameters
    ----------
    frames : int
        Captures that are averaged for each step.
    step : float
        Adam's first step [rad], cosine-decayed to zero over the captures, so that camera noise is averaged out.
    smoothing : float
        Width [px] of the Gaussian that the captured error is filtered with: the ideal model knows least about the
        finest detail.
    """

    frames: Annotated[int, Interval(ge=1, le=100)] = 1
    step: Annotated[float, Interval(gt=0, le=10)] = 0.08
    smoothing: Annotated[float, Interval(ge=0, le=10)] = 0.7

    title: ClassVar[str] = "camera in the loop"

    def _optimise(
        self, phase: Tensor, target: Tensor, bench: MeteredDisplay, camera: Camera, kept: int, index: int
    ) -> Tensor:
        optimiser = torch.optim.Adam([phase], lr=self.step, betas=MOMENTS)
        steps = (camera.left - kept) // self.frames
        for number in range(steps):
            capture = camera.show(phase, self.frames)
            phase.grad = self._gradient(phase, capture, target, bench.spec)
            optimiser.param_groups[0]["lr"] = cosine_decay(self.step, number / steps)
            optimiser.step()
        return phase

    def _gradient(self, phase: Tensor, capture: Tensor, target: Tensor, spec: DisplaySpec) -> Tensor:
        """Slope ``(C, H, W)`` of the squared error of intensity, as ``wirtinger.Objective`` has it.

        The field in the region has the amplitude of the capture and the phase of the ideal model.
        """
        image = matched(capture, target)
        error = image - target
        if self.smoothing:
            error = gaussian_blur(error[None], self.smoothing)[0]
        slope = error * image.clamp_min(0).sqrt()
        gradients = []
        for colour, panel in enumerate(phase):  # one at a time, for the memory
            model, at_panel = spec.propagator(colour, device=panel.device), unit_field(panel)
            direction = torch.sgn(spec.region.crop(model.forward(at_panel)))
            returned = model.adjoint(spec.region.embed(slope[colour] * direction, model.shape))
            gradients.append((at_panel.conj() * returned).imag)
        return torch.stack(gradients)
