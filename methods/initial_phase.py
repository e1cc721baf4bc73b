"""Where phase retrieval starts."""

from __future__ import annotations

from typing import Literal

import torch
from torch import Tensor

from ..display.api import DisplaySpec
from ..display.traits import refuse_plane, traits_of
from ..optics.phase import TAU, lens
from .common import Bench
from .double_phase import DoublePhase

InitialPhase = Literal["random", "narrow", "constant", "quadratic", "dpe"]


def initial_phase(kind: InitialPhase, target: Tensor, bench: Bench, channel: int) -> Tensor:
    """A phase ``(B, H, W)`` [rad] to start from; target: linear intensity ``(B, h, w)``.

    random: uniform over 2 pi, the same for every image of a batch, so that an image's result does not depend
    on its company; narrow: the same over 1 rad (as in the released code of Peng et al. 2020); constant: zero;
    quadratic: the lens that gathers the light of the whole panel in the region; dpe: the double phase hologram
    (Maimone et al. 2017), which already shows the image. In a Fourier plane a constant phase is a spot: there the lens
    is added to constant and narrow too, and dpe is refused (UserError).
    """
    spec = bench.spec
    if kind == "dpe":
        refuse_plane(traits_of(DoublePhase), "initial_phase: dpe", spec)
        return DoublePhase(offset="none").retrieve(target, bench, channel)
    if kind in ("random", "narrow"):
        draw = torch.rand(spec.shape, generator=bench.generator("initial phase", channel), dtype=torch.float64)
        phase = (draw * (TAU if kind == "random" else 1.0)).to(target.device, target.dtype)
    else:
        phase = target.new_zeros(spec.shape)
    if kind == "quadratic" or (spec.plane == "fourier" and kind != "random"):
        phase = phase + gathering_lens(spec, channel, target)
    return phase.expand(target.shape[0], *spec.shape).clone()


def gathering_lens(spec: DisplaySpec, channel: int, like: Tensor) -> Tensor:
    """Phase ``(H, W)`` [rad] of the lens that shrinks the panel to the region at the image plane."""
    if spec.plane == "fourier":
        return _aimed(spec, channel).to(like)
    magnification = max(spec.region.height / spec.shape[0], spec.region.width / spec.shape[1])
    if magnification >= 1:
        return like.new_zeros(spec.shape)
    focal_length = spec.distance / (1 - magnification)
    return lens(spec.shape, spec.pitch, spec.wavelengths[channel], focal_length, dtype=like.dtype, device=like.device)


def _aimed(spec: DisplaySpec, channel: int) -> Tensor:
    """Phase ``(H, W)`` [rad], float64, whose slope at each place of the panel is that place of the region, upright."""
    region, step, axes = spec.region, spec.step(channel), []
    for size, first, window in zip(spec.shape, (region.top, region.left), region.shape, strict=True):
        x = torch.arange(size, dtype=torch.float64) - (size - 1) / 2
        middle = first + (window - 1) / 2 - size // 2
        axes.append(TAU * step * (middle * x + window / (2 * size) * x * x))
    return axes[0][:, None] + axes[1]
