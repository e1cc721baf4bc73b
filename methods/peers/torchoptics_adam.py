"""Phase retrieval with torchoptics as the model of the light.

torchoptics (M. J. Filipovich & A. I. Lvovsky, arXiv:2411.18591, MIT licence): a ``System`` of one trainable
``PhaseModulator``, measured at the image plane, as in its example of a trained diffractive splitter.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

import torch
from annotated_types import Interval
from torch import Tensor

from ...display.api import DisplaySpec
from ..common import Bench, ByColour
from ..descent import Best
from ..initial_phase import InitialPhase, initial_phase
from ..losses import LOSSES, LossName
from .loading import load, unavailable


@dataclass(frozen=True)
class TorchOpticsAdam(ByColour):
    """torchoptics: Adam on the phase through torchoptics' propagation (needs the extra 'peers').

    With the defaults it is ``wirtinger`` with another model of the light: the same loss in the region, start and
    step, and the phase of the least loss, but a gradient by autograd in double precision, torchoptics' default. SI
    units throughout.

    Parameters
    ----------
    iterations : int
        Evaluations of loss and gradient.
    loss : str
        Error in the region, at the best brightness and as a share of the target's own size. intensity_l2, amplitude_l2:
        squared, of intensity (Eq. 12 of Chakravarthula et al. 2020) or amplitude; intensity_l1: absolute, of intensity;
        huber: squared up to 0.1 and linear above; ms_ssim: 0.84 (1 - MS-SSIM) and 0.16 of the absolute error.
    step : float
        Adam's step [rad].
    initial_phase : str
        Where the descent starts. random: uniform over 2 pi; narrow: uniform over 1 rad; constant: zero; quadratic: the
        lens that gathers the light of the panel in the region; dpe: the double phase hologram.
    propagation : str
        A method of torchoptics; its angular spectrum has neither a band limit nor an iris.
    padding : float
        Samples added to each side of the panel for the angular spectrum, in panels. torchoptics' own default of 2
        computes on 25 times the panel's area; 0.5 keeps light from coming round where it spreads less than a panel.
    """

    iterations: Annotated[int, Interval(ge=1, le=100_000)] = 200
    loss: LossName = "intensity_l2"
    step: Annotated[float, Interval(gt=0, le=10)] = 0.1
    initial_phase: InitialPhase = "constant"
    propagation: Literal["AUTO", "ASM", "DIM", "ASM_FRESNEL", "DIM_FRESNEL"] = "AUTO"
    padding: Annotated[float, Interval(ge=0, le=4)] = 0.5

    title: ClassVar[str] = "Adam through TorchOptics"
    fresnel: ClassVar[bool] = True

    def available(self) -> str | None:
        """Why the method cannot run here, in one line; None if it can."""
        return unavailable(lambda: load("torchoptics"))

    def retrieve(self, target: Tensor, bench: Bench, channel: int) -> Tensor:
        """The phase of the least loss that was seen; UserError where torchoptics is not installed."""
        start = initial_phase(self.initial_phase, target, bench, channel)
        pairs = zip(target, start, strict=True)
        return torch.stack([self._descend(image, phase, bench.spec, channel) for image, phase in pairs])

    def _descend(self, target: Tensor, start: Tensor, spec: DisplaySpec, channel: int) -> Tensor:
        """One image: target ``(h, w)``, start and result ``(H, W)`` [rad]; a modulator of torchoptics has one phase."""
        light, system = _display(start, spec, channel)
        pad = [round(self.padding * side) for side in spec.shape]
        (phase,) = system.parameters()
        wanted, best = target.to(phase)[None], Best(phase[None])
        optimiser = torch.optim.Adam([phase], lr=self.step)
        for _ in range(self.iterations):
            image = system.measure_at_z(light, spec.distance, propagation_method=self.propagation, asm_pad=pad)
            loss = LOSSES[self.loss](spec.region.crop(image.intensity())[None], wanted)
            best.update(loss, phase[None])
            # the factor keeps the gradient far above Adam's epsilon
            (phase.grad,) = torch.autograd.grad(phase.numel() * loss.sum(), phase)
            optimiser.step()
        return best.phase[0].to(target)


def _display(start: Tensor, spec: DisplaySpec, channel: int) -> tuple[Any, Any]:
    """Even light on the panel, and the panel with ``start`` ``(H, W)`` [rad] as its phase; both lie at z = 0."""
    optics, elements = load("torchoptics"), load("torchoptics.elements")
    panel = elements.PhaseModulator(torch.nn.Parameter(start), z=0, spacing=spec.pitch)
    even = torch.ones(spec.shape, dtype=torch.complex128)
    light = optics.Field(even, wavelength=spec.wavelengths[channel], z=0, spacing=spec.pitch)
    return light.to(start.device), optics.System(panel).to(start.device)
