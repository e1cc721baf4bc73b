"""The light that leaves the panel, from the phase of a hologram: the part of a bench that is not linear."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ...core.compiled import usable
from ...optics.blocks import in_blocks
from ...optics.linear import linear
from ...optics.phasor import phasor
from .kernels import modulate_back_rows, modulate_rows
from .path import Light
from .stages.crosstalk import Crosstalk
from .stages.lut import LookUpTable
from .stages.panel import straight_through_level

Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class PanelLight:
    """Gray levels, look-up table, crosstalk and the light on the panel, for one line of the source.

    bits: of the panel; channel: of the look-up table; weights: of the crosstalk ``(2, samples, taps)``; modulated,
    unmodulated: amplitude of the light of each sub-sample that follows the phase, and that does not
    ``(samples, samples, 1, 1)``; added: phase [rad] that the display adds to every hologram; lut_gain; incident:
    complex amplitude of the light; lut_bend: see ``LookUpTable.bend_map``: ``(H, W)``.
    """

    bits: int
    channel: int
    lut: LookUpTable
    crosstalk: Crosstalk
    weights: Tensor
    modulated: Tensor
    unmodulated: Tensor
    added: Tensor
    lut_gain: Tensor
    incident: Tensor
    lut_bend: Tensor | None = None

    def ready(self, phase: Tensor) -> bool:
        """Whether compiled functions can light the panel with this phase, and need no gradient."""
        return self.lut_bend is None and usable(phase) and phase.dtype == torch.float32

    def field(self, phase: Tensor, gain: float) -> Tensor:
        """Field ``(samples, samples, H, W)`` of the sub-samples, the carrier off, of ``phase`` ``(H, W)`` [rad].

        Differentiable once; gain: of the phase in this frame, relative.
        """
        if not self.ready(phase.detach()):
            return self.in_torch(phase, gain)
        field = self.whole(phase.detach(), gain)
        return linear(
            lambda _: field,
            lambda grad, kept, shown: self.back(grad, kept, shown, gain),
            phase,
            field.detach(),
            phase.detach(),
        )

    def in_torch(self, phase: Tensor, gain: float) -> Tensor:
        """``field`` by torch: the reference for compiled code, in its place where it cannot be."""
        level = straight_through_level(phase + self.added, self.bits)
        driven = self.lut.phase(level, self.bits, self.lut_gain * gain, self.channel, self.lut_bend)
        fine = self.crosstalk.apply(driven, self.weights).view(*self.modulated.shape[:2], *driven.shape)
        return (phasor(self.modulated, fine) + self.unmodulated) * self.incident

    def rows(self, phase: Tensor, gain: float) -> Light:
        """``field`` a few rows at a time, compiled and without a gradient; for a phase that is ``ready``."""
        lit, samples = self._lit(phase, gain), self.weights.shape[1]
        shares = self._curve[0], self.modulated[:, :, 0, 0].numpy()

        def light(rows: slice) -> Tensor:
            some = (samples, samples, rows.stop - rows.start, phase.shape[1])
            field = torch.empty(some, dtype=torch.complex64, device="cpu")
            modulate_rows(lit, *shares, rows.start, rows.stop, _planes(field))
            return field

        return light

    def whole(self, phase: Tensor, gain: float) -> Tensor:
        """``field``, compiled and without a gradient."""
        light, shape = self.rows(phase, gain), (*self.modulated.shape[:2], *phase.shape)
        field = torch.empty(shape, dtype=torch.complex64, device="cpu")
        in_blocks(lambda rows: field[:, :, rows].copy_(light(rows)), field, len(phase), field.numel())
        return field

    def back(self, grad: Tensor, field: Tensor, phase: Tensor, gain: float) -> Tensor:
        """Gradient ``(H, W)`` in the phase, from that in the ``field``."""
        lit, slope = self._lit(phase, gain), self._curve[1]
        result = torch.empty(phase.shape, dtype=torch.float32, device="cpu")
        parts = _planes(grad.contiguous().resolve_conj().resolve_neg()), _planes(field)

        def back(rows: slice) -> None:
            modulate_back_rows(lit, slope, *parts, rows.start, rows.stop, result.numpy())

        in_blocks(back, field, len(phase), field.numel())
        return result

    def _lit(self, phase: Tensor, gain: float) -> tuple[Any, ...]:
        """What compiled functions take first."""
        drive = phase.detach().contiguous().numpy(), self.added.numpy(), self.lut_gain.numpy(), gain
        return *drive, self.weights.numpy(), _floats(self.unmodulated[:, :, 0, 0]), _planes(self.incident)

    @cached_property
    def _curve(self) -> tuple[Floats, Floats]:
        """Phase [rad] of every gray level, and its slope in the phase that is asked for."""
        with torch.inference_mode(mode=False), torch.enable_grad():
            level = torch.arange(2.0**self.bits, dtype=torch.float32, device="cpu").requires_grad_()
            shown = self.lut.phase(level, self.bits, level.new_ones(()), self.channel)
            (slope,) = torch.autograd.grad(shown.sum(), level)
        return shown.detach().numpy(), (slope * (2**self.bits / math.tau)).numpy()


def _floats(field: Tensor) -> Floats:
    parts: Floats = torch.view_as_real(field).numpy()
    return parts


def _planes(field: Tensor) -> Floats:
    """Real and imaginary parts in turn: ``(..., H, W)`` to ``(..., H, 2 W)``."""
    return _floats(field).reshape(*field.shape[:-1], -1)
