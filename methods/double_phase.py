"""Double phase encoding: a complex field shown on a phase-only panel without iteration.

Maimone, Georgiou & Kollin, "Holographic near-eye displays for virtual and augmented reality",
ACM Trans. Graph. 36(4), 85 (2017), after Hsueh & Sawchuk, Appl. Opt. 17, 3874 (1978).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import torch
from annotated_types import Interval
from torch import Tensor

from ..optics.convolution import frequencies, iris
from .common import Bench, ByColour, Offset, nominal_model, with_offset


@dataclass(frozen=True)
class DoublePhase(ByColour):
    """Double phase amplitude coding (Maimone et al. 2017).

    The image plane holds the target amplitude with constant phase, and black outside the region. SI units throughout.

    Parameters
    ----------
    quantile : float
        The amplitude at the panel that is encoded as 1; larger ones are cut to 1. 1 is the maximum, as published; a
        lower quantile gives a brighter image and more clipping.
    offset : {"none", "centre"}
        Constant phase that is added in the end. none: zero; centre: the one that brings the phase of the fewest pixels
        to the wrap between 0 and 2 pi, whose edges a panel blurs.
    """

    quantile: Annotated[float, Interval(gt=0, le=1)] = 1.0
    offset: Offset = "centre"

    title: ClassVar[str] = "double-phase encoding"
    fresnel: ClassVar[bool] = True

    def retrieve(self, target: Tensor, bench: Bench, channel: int) -> Tensor:
        """The complex field at the panel that gives the target, encoded without iteration."""
        spec = bench.spec
        amplitude = spec.region.embed(target.clamp_min(0).sqrt(), spec.shape)
        at_image = torch.complex(amplitude, torch.zeros_like(amplitude))
        at_panel = self.filter(nominal_model(bench, channel, target).adjoint(at_image), spec.pitch)
        return with_offset(encode(at_panel, self.quantile), self.offset)

    def filter(self, field: Tensor, pitch: float) -> Tensor:
        """What is done to the complex field at the panel before it is encoded: nothing."""
        return field


@dataclass(frozen=True)
class AntiAliasedDoublePhase(DoublePhase):
    """Anti-aliased double phase (Shi et al., "Towards real-time photorealistic 3D holography with deep neural
    networks", Nature 591, 234 (2021), Methods).

    The complex field at the panel is blurred by a small Gaussian before encoding, so that neighbours in the
    checkerboard encode nearly the same value and fast phase changes do not alias. The other parameters are those of
    double_phase.

    Parameters
    ----------
    sigma : float
        Standard deviation of the Gaussian [px].
    """

    sigma: Annotated[float, Interval(gt=0, le=5)] = 0.5

    title: ClassVar[str] = "double phase, anti-aliased"

    def filter(self, field: Tensor, pitch: float) -> Tensor:
        """Gaussian blur of the complex field."""
        fy, fx = frequencies(_padded(field), pitch, field.device)
        transfer = torch.exp(-2 * (torch.pi * self.sigma * pitch) ** 2 * (fy**2 + fx**2))
        return _filtered(field, transfer)


@dataclass(frozen=True)
class BandLimitedDoublePhase(DoublePhase):
    """Band-limited double phase (Sui et al., "Band-limited double-phase method for enhancing image sharpness in
    complex modulated computer-generated holograms", Opt. Express 29, 2597 (2021)).

    The checkerboard of the encoding repeats the spectrum around the corners of the band (half a cycle per pixel
    in both directions). The field is limited to a band before encoding, so that those copies keep clear of it. The
    other parameters are those of double_phase.

    Parameters
    ----------
    band : float
        Diameter of the limit as a fraction of the panel's band 1/pitch: at most 1/sqrt(2) for a round one, 1/2 for a
        square.
    shape : {"round", "square"}
        Form of the limit.
    """

    band: Annotated[float, Interval(gt=0, le=1)] = 0.7
    shape: Literal["round", "square"] = "round"

    title: ClassVar[str] = "double phase, band-limited"

    def filter(self, field: Tensor, pitch: float) -> Tensor:
        """Ideal low-pass of the complex field."""
        fy, fx = frequencies(_padded(field), pitch, field.device)
        edge = self.band / (2 * pitch)
        passed = iris(fy, fx, pitch, self.band) if self.shape == "round" else (fy.abs() <= edge) & (fx.abs() <= edge)
        return _filtered(field, passed)


def encode(field: Tensor, quantile: float = 1.0, largest: float = 1.0) -> Tensor:
    """Two phases ``phi +- arccos(a)`` in a checkerboard, whose mean is ``a exp(i phi)`` (Maimone et al. 2017).

    Parameters
    ----------
    field : Tensor
        ``(..., H, W)``, complex; a is its amplitude over its maximum in the panel.
    quantile : float
        Of the amplitude, in the place of its maximum.
    largest : float
        Amplitude a that larger ones are cut to; below 1 the gradient is finite.

    Returns
    -------
    Tensor
        Phase ``(..., H, W)`` [rad].

    Examples
    --------
    >>> encode(torch.tensor([[1 + 0j, 0j], [0.5j, 1j]]))
    tensor([[ 0.0000, -1.5708],
            [ 0.5236,  1.5708]])
    """
    amplitude, phase = field.abs(), field.angle()
    if quantile == 1:
        white = amplitude.amax(dim=(-2, -1), keepdim=True)
    else:
        # kthvalue, since torch.quantile refuses more than 2^24 values; it has no deterministic form on a GPU
        flat = amplitude.flatten(-2).cpu()
        rank = max(1, round(quantile * flat.shape[-1]))
        white = flat.kthvalue(rank, dim=-1).values[..., None, None].to(field.device)
    spread = torch.acos((amplitude / white.clamp_min(torch.finfo(white.dtype).tiny)).clamp(max=largest))
    rows, columns = field.shape[-2:]
    parity = (
        torch.arange(rows, device=field.device)[:, None] + torch.arange(columns, device=field.device)[None, :]
    ) % 2
    return phase + torch.where(parity == 0, spread, -spread)


def _padded(field: Tensor) -> tuple[int, int]:
    return 2 * field.shape[-2], 2 * field.shape[-1]


def _filtered(field: Tensor, transfer: Tensor) -> Tensor:
    """Filter a field with zeros around it; the transfer function is on the ``fftfreq`` grid of twice its size."""
    rows, columns = field.shape[-2:]
    spectrum = torch.fft.fft2(field, s=_padded(field)) * transfer.to(field.real.dtype)
    filtered: Tensor = torch.fft.ifft2(spectrum)
    return filtered[..., :rows, :columns]
