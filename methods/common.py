"""What several methods share: the nominal model, closed-form scales, the global phase offset."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Literal, Protocol

import torch
from torch import Tensor

from ..display.api import DisplaySpec
from ..optics import Propagator
from ..optics.phase import TAU, wrap
from ..optics.phasor import phasor

Offset = Literal["none", "centre"]

TINY = 1e-12
_HISTOGRAM_BINS = 256


class Bench(Protocol):
    """What a method without camera uses of a bench."""

    @property
    def spec(self) -> DisplaySpec:
        """Nominal optics."""

    def generator(self, *names: object) -> torch.Generator:
        """Named random numbers of this cell."""

    def solved(self, method: Any, target: Tensor) -> Tensor:
        """Phases ``(B, C, H, W)`` [rad] by another method without camera, solved once where phases are kept."""


class ByColour(ABC):
    """A method that solves the colours of a target one after the other, each at its wavelength."""

    def solve(self, target: Tensor, bench: Bench) -> Tensor:
        """Phases by `retrieve`.

        Parameters
        ----------
        target : Tensor
            Linear intensity ``(B, C, h, w)`` in [0, 1].
        bench : Bench
            Nominal optics in SI units, and named random numbers.

        Returns
        -------
        Tensor
            Phase ``(B, C, H, W)``, or of several frames ``(B, F, C, H, W)`` [rad].
        """
        return per_channel(target, lambda image, channel: self.retrieve(image, bench, channel))

    @abstractmethod
    def retrieve(self, target: Tensor, bench: Bench, channel: int) -> Tensor:
        """One colour: linear intensity ``(B, h, w)`` to phase ``(B, H, W)`` or frames ``(B, F, H, W)`` [rad]."""


def per_channel(target: Tensor, solve_channel: Callable[[Tensor, int], Tensor]) -> Tensor:
    """Solve the colours of ``(B, C, h, w)`` one after the other (each has its wavelength), to ``(B, C, H, W)``."""
    colours = enumerate(target.unbind(1))
    return torch.stack([solve_channel(colour.contiguous(), channel) for channel, colour in colours], dim=-3)


def nominal_model(bench: Bench, channel: int, like: Tensor) -> Propagator:
    """The ideal propagator of a channel, in the precision and on the device of ``like``."""
    return bench.spec.propagator(channel, dtype=torch.complex(like, like).dtype, device=like.device)


def unit_field(phase: Tensor) -> Tensor:
    """``exp(i phase)`` of a phase [rad]."""
    return phasor(phase.new_ones(()), phase)


def intensity_scale(intensity: Tensor, target: Tensor) -> Tensor:
    """The factor s that minimises ``sum((s I - T)^2)``: ``sum(I T) / sum(I I)``, ``(B, h, w)`` twice to ``(B, 1, 1)``.

    The amplitudes have the same form. It is differentiable, and zero for a black target.
    """
    overlap = (intensity * target).sum(dim=(-2, -1), keepdim=True)
    return overlap / intensity.square().sum(dim=(-2, -1), keepdim=True).clamp_min(TINY)


def matched(image: Tensor, target: Tensor) -> Tensor:
    """An image ``(..., h, w)`` at the brightness of its target, by the least-squares factor of each channel.

    Examples
    --------
    >>> target = torch.tensor([[[1.0, 0.5]]])
    >>> matched(4 * target, target)
    tensor([[[1.0000, 0.5000]]])
    """
    return image * intensity_scale(image, target)


def safe_amplitude(intensity: Tensor) -> Tensor:
    """Square root of an intensity; the gradient of a vanishing intensity is zero, not infinite."""
    return intensity.clamp_min(TINY).sqrt()


def with_offset(phase: Tensor, policy: Offset) -> Tensor:
    """Add the constant phase [rad] of a policy to every panel of ``(..., H, W)``.

    A constant does not change an ideal image, but it decides where the phase wraps, and a panel blurs its wrap
    edges (crosstalk). "none" leaves the phase as the algorithm gave it. "centre" moves the least populated
    phase value to the wrap edge 0 / 2 pi: the smallest count of a circularly smoothed histogram of the wrapped
    phase. It is computed from the phase alone, without a look at the display.
    """
    if policy == "none":
        return phase
    panels = phase.reshape(-1, *phase.shape[-2:])
    gaps = torch.stack([_least_populated(panel) for panel in panels])
    return phase - gaps.to(phase).reshape(*phase.shape[:-2], 1, 1)


def _least_populated(panel: Tensor) -> Tensor:
    """The phase value [rad] near which the fewest pixels of a panel lie, by a histogram smoothed over 2 pi."""
    panel = panel.cpu()  # no deterministic histogram on a GPU
    counts = torch.histc(wrap(panel).double(), bins=_HISTOGRAM_BINS, min=0.0, max=TAU)
    # A raised cosine of period 2 pi, to the 8th power: a window of 1.2 rad full width at half maximum,
    # so a broad valley wins over a narrow empty bin.
    angles = torch.arange(_HISTOGRAM_BINS, dtype=torch.float64) * (TAU / _HISTOGRAM_BINS)
    window = ((1 + torch.cos(angles)) / 2) ** 8
    smooth = torch.fft.irfft(torch.fft.rfft(counts) * torch.fft.rfft(window), n=_HISTOGRAM_BINS)
    least: Tensor = smooth.argmin()
    return (least + 0.5) * (TAU / _HISTOGRAM_BINS)
