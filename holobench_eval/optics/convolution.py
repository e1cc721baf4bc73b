"""The common form of the near-field propagators: pad, transform, multiply, transform back, crop."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Protocol

import torch
from torch import Tensor

from .padding import IRIS_EDGE


class Propagator(Protocol):
    """A linear map between two planes, and its adjoint."""

    def forward(self, field: Tensor) -> Tensor:
        """Propagate a complex field ``(..., H, W)`` from the panel to the image plane."""
        ...

    def adjoint(self, field: Tensor) -> Tensor:
        """The adjoint map: ``<forward(u), v> = <u, adjoint(v)>``."""
        ...


class Convolution:
    """A shift-invariant propagator given by its transfer function on the padded ``fftfreq`` grid.

    The field sits in the corner of the padded array, so no shifts are needed; the transfer function carries
    no constant phase exp(ikz).
    """

    def __init__(self, shape: tuple[int, int], transfer: Tensor) -> None:
        self.shape = shape
        self.transfer = transfer

    @property
    def padded_shape(self) -> tuple[int, int]:
        """(rows, columns) of the transform."""
        return self.transfer.shape[-2], self.transfer.shape[-1]

    def forward(self, field: Tensor) -> Tensor:
        """Propagate ``(..., H, W)`` complex to ``(..., H, W)``; differentiable."""
        return self._convolve(field, self.transfer)

    def adjoint(self, field: Tensor) -> Tensor:
        """The adjoint of ``forward``; for a pure phase transfer function this propagates back."""
        return self._convolve(field, self._conjugate)

    @cached_property
    def _conjugate(self) -> Tensor:
        """The transfer function of the adjoint, formed once: a lazy conjugate is formed in every product."""
        return self.transfer.conj().resolve_conj()

    def _convolve(self, field: Tensor, transfer: Tensor) -> Tensor:
        height, width = self.shape
        if tuple(field.shape[-2:]) != (height, width):
            raise ValueError(f"field is {tuple(field.shape[-2:])}, the propagator was made for {self.shape}")
        spectrum = torch.fft.fft2(field, s=self.padded_shape)
        spectrum = spectrum.to(torch.promote_types(spectrum.dtype, transfer.dtype))
        return torch.fft.ifft2(multiply(spectrum, transfer))[..., :height, :width]


def multiply(scratch: Tensor, factor: Tensor) -> Tensor:
    """``scratch * factor``, in place where no gradient needs ``scratch``: a new array costs as much as the product."""
    return scratch * factor if scratch.requires_grad else scratch.mul_(factor)


def frequencies(shape: tuple[int, int], pitch: float, device: torch.device | str = "cpu") -> tuple[Tensor, Tensor]:
    """Spatial frequencies [1/m] of an FFT grid as a column ``(H, 1)`` and a row ``(1, W)``, float64."""
    fy = torch.fft.fftfreq(shape[0], pitch, dtype=torch.float64, device=device)[:, None]
    fx = torch.fft.fftfreq(shape[1], pitch, dtype=torch.float64, device=device)[None, :]
    return fy, fx


def iris(fy: Tensor, fx: Tensor, pitch: float, pupil: float | None) -> Tensor:
    """Amplitude of a circular iris in the Fourier plane; diameter ``pupil`` of the panel's band 1/pitch, float64.

    The edge is a raised cosine from 0.95 to 1.05 of the radius: a hard one has tails across the whole image
    that only several times the padding removes, and an iris a little out of the Fourier plane is not hard.
    """
    if pupil is None:
        return torch.ones(torch.broadcast_shapes(fy.shape, fx.shape), dtype=torch.float64, device=fy.device)
    radius = torch.sqrt(fy**2 + fx**2) * (2 * pitch / pupil)
    edge = ((radius - (1 - IRIS_EDGE)) / (2 * IRIS_EDGE)).clamp(0.0, 1.0)
    return 0.5 * (1 + torch.cos(math.pi * edge))
