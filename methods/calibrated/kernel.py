"""Calibration of the light transport alone: one complex kernel a colour in the place of the ideal propagation.

Kavakli, Urey & Aksit, "Learned holographic light transport", Applied Optics 61(5), B50-B55 (2022).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor, nn

from ...display.api import DisplaySpec
from ..common import unit_field
from ..learned.samples import Steps
from .approximator import ModelApproximator, Rates
from .method import Calibrated, ShortSchedule


class Kernels(nn.Module):
    """Phase to field by a convolution, of which every value of the transfer function is free.

    transfer: of each colour, ``(rows, columns, 2)`` real and imaginary, on the padded grid of the ideal propagator and
    with its values at first. brightness: logarithm of the camera's gain, per colour.
    """

    def __init__(self, spec: DisplaySpec) -> None:
        super().__init__()
        self.spec = spec
        ideal = [spec.transfer(channel) for channel in range(len(spec.wavelengths))]
        self.transfer = nn.ParameterList(
            torch.view_as_real(transfer).clone(memory_format=torch.contiguous_format) for transfer in ideal
        )
        self.brightness = nn.Parameter(torch.zeros(len(ideal)))

    def forward(self, phase: Tensor) -> Tensor:
        """Field ``(C, h, w)`` in the region for a phase ``(C, H, W)`` [rad]."""
        fields = []
        for panel, transfer in zip(phase, self.transfer, strict=True):
            learned = torch.view_as_complex(transfer)
            spectrum = torch.fft.fft2(unit_field(panel), s=learned.shape)
            fields.append(self.spec.region.crop(torch.fft.ifft2(spectrum * learned)))
        return torch.stack(fields) * torch.exp(self.brightness / 2)[:, None, None]


@dataclass(frozen=True)
class OneRound(ShortSchedule):
    """All captures before the training, as in the paper."""

    rounds: Annotated[int, Interval(ge=1, le=100)] = 1
    images: Annotated[int, Interval(ge=1)] | None = 48
    steps: Steps = 400


@dataclass(frozen=True)
class LearnedKernel(Calibrated):
    """A complex convolution kernel a colour, learned from captures of holograms of the ideal model.

    As in the paper, captures are of natural holograms alone, and only of those of the ideal model. The paper learns the
    kernel's values; here they are those of its Fourier transform, which is the same family of kernels. The parameters
    are those of all calibrated methods. SI units throughout.
    """

    training: OneRound = OneRound()
    patterns: Annotated[int, Interval(ge=0, le=1000)] = 0

    title: ClassVar[str] = "a learned propagation kernel"
    RATES: ClassVar[Rates] = Rates(model=1e-2)

    def approximator(self, spec: DisplaySpec) -> ModelApproximator:
        """The ideal transfer functions."""
        return ModelApproximator(Kernels(spec), None, self.RATES)
