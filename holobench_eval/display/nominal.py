"""What the nominal model makes of a phase."""

from __future__ import annotations

import torch
from torch import Tensor

from ..optics.phase import blaze, gray_level
from ..optics.phasor import phasor, squared_modulus
from .api import DisplaySpec

FINE = 8  # bits, whose rounding hardly shows


def ideal_image(phase: Tensor, spec: DisplaySpec) -> Tensor:
    """The intensity that the nominal model makes of a phase, see also ``nominal_levels``.

    Parameters
    ----------
    phase
        ``(C, H, W)`` [rad], or frames ``(F, C, H, W)``.
    spec
        The display's nominal optics.

    Returns
    -------
    Tensor
        ``(C, h, w)`` in the region, of frames their mean; the mean incident light on the panel is 1.
    """
    return spec.region.crop(ideal_light(phase, spec))


def ideal_light(phase: Tensor, spec: DisplaySpec) -> Tensor:
    """`ideal_image` in the entire image plane, ``(C, H, W)``, the light beside the region too."""
    if phase.ndim == 4:
        return torch.stack([ideal_light(frame, spec) for frame in phase]).mean(0)
    return squared_modulus(propagated(phasor(phase.new_ones((), dtype=torch.float32), phase.float()), spec))


def propagated(fields: Tensor, spec: DisplaySpec, back: bool = False) -> Tensor:
    """Fields ``(C, H, W)`` of all colours, complex64, from the panel to the image plane; or back, by the adjoint."""
    models = (spec.propagator(channel, device=fields.device) for channel in range(len(fields)))
    ways = [model.adjoint if back else model.forward for model in models]
    return torch.stack([way(field) for way, field in zip(ways, fields, strict=True)])


def nominal_levels(phase: Tensor, spec: DisplaySpec) -> Tensor:
    """Nominal phase of the light where a panel is given a phase ``(..., C, H, W)`` [rad]: by the maker's table or, of
    fewer than 8 bits, by equal steps; of more, the phase itself. The gradient is that of the phase."""
    if not spec.levels and spec.bits >= FINE:
        return phase
    ramp = blaze(spec.shape, spec.blaze).to(phase)
    colours = gray_level(phase.detach() + ramp, spec.bits).long().unbind(-3)
    light = torch.stack([spec.level_phases(c).to(phase)[level] for c, level in enumerate(colours)], dim=-3) - ramp
    return phase + (light - phase.detach())
