"""The common form of the near-field propagators: pad, transform, multiply, transform back, crop."""

from __future__ import annotations

import math
from typing import Any, Protocol

import torch
from torch import Tensor

from .padding import IRIS_EDGE
from .transfer import TransferFunction


class Propagator(Protocol):
    """A linear map between two planes, and its adjoint."""

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the fields."""

    @property
    def dtype(self) -> torch.dtype:
        """Of the fields, complex."""

    def forward(self, field: Tensor) -> Tensor:
        """Propagate a complex field ``(..., H, W)`` from the panel to the image plane."""

    def adjoint(self, field: Tensor) -> Tensor:
        """The adjoint map: ``<forward(u), v> = <u, adjoint(v)>``."""

    def carried(self, field: Tensor, back: bool = False, spent: bool = False) -> Tensor:
        """``forward`` or, back, ``adjoint``, of a field in the precision of the model, where no gradient is asked for.

        spent: the result may take the place of the field in memory.
        """


class Convolution:
    """A shift-invariant propagator given by its transfer function.

    The field sits in the corner of the padded array, so no shifts are needed; the transfer function carries
    no constant phase exp(ikz).

    Parameters
    ----------
    shape
        Rows and columns of the fields.
    transfer
        On the padded ``fftfreq`` grid.
    """

    def __init__(self, shape: tuple[int, int], transfer: TransferFunction) -> None:
        self.shape = shape
        self.transfer = transfer

    @property
    def dtype(self) -> torch.dtype:
        """Of the fields, complex."""
        return self.transfer.dtype

    @property
    def padded_shape(self) -> tuple[int, int]:
        """(rows, columns) of the transform."""
        return self.transfer.shape

    def forward(self, field: Tensor) -> Tensor:
        """Propagate ``(..., H, W)`` complex to ``(..., H, W)``, in the precision of the model; differentiable."""
        return self._convolve(field, conjugated=False)

    def adjoint(self, field: Tensor) -> Tensor:
        """The adjoint of ``forward``; for a pure phase transfer function this propagates back."""
        return self._convolve(field, conjugated=True)

    def carried(self, field: Tensor, back: bool = False, spent: bool = False) -> Tensor:
        """See ``Propagator``."""
        return self.transfer.convolve(field, back, spent)

    def _convolve(self, field: Tensor, conjugated: bool) -> Tensor:
        if tuple(field.shape[-2:]) != self.shape:
            raise ValueError(f"field is {tuple(field.shape[-2:])}, the propagator was made for {self.shape}")
        convolved: Tensor = _Convolved.apply(field.to(self.transfer.dtype), self.transfer, conjugated)  # type: ignore[no-untyped-call]
        return convolved


class _Convolved(torch.autograd.Function):
    """The gradient of a convolution is its adjoint; recorded operations would keep every padded array."""

    @staticmethod
    def forward(ctx: Any, field: Tensor, transfer: TransferFunction, conjugated: bool) -> Tensor:
        ctx.transfer, ctx.conjugated = transfer, conjugated
        return transfer.convolve(field, conjugated)

    @staticmethod
    def backward(ctx: Any, *grad: Tensor) -> tuple[Tensor, None, None]:
        returned: Tensor = _Convolved.apply(grad[0], ctx.transfer, not ctx.conjugated)  # type: ignore[no-untyped-call]
        return returned, None, None


def frequencies(shape: tuple[int, int], pitch: float, device: torch.device | str = "cpu") -> tuple[Tensor, Tensor]:
    """Spatial frequencies of an FFT grid.

    Parameters
    ----------
    shape
        Rows and columns.
    pitch
        Of the samples [m].
    device
        Of the result.

    Returns
    -------
    fy, fx
        A column ``(H, 1)`` and a row ``(1, W)`` [1/m], float64.

    Examples
    --------
    >>> fy, fx = frequencies((2, 4), pitch=0.25)
    >>> fx
    tensor([[ 0.,  1., -2., -1.]], dtype=torch.float64)
    """
    fy = torch.fft.fftfreq(shape[0], pitch, dtype=torch.float64, device=device)[:, None]
    fx = torch.fft.fftfreq(shape[1], pitch, dtype=torch.float64, device=device)[None, :]
    return fy, fx


def iris(fy: Tensor, fx: Tensor, pitch: float, pupil: float | None) -> Tensor:
    """Amplitude of a circular iris in the Fourier plane.

    The edge is a raised cosine from 0.95 to 1.05 of the radius: a hard one has tails across the whole image
    that only several times the padding removes, and an iris a little out of the Fourier plane is not hard.

    Parameters
    ----------
    fy, fx
        Spatial frequencies [1/m].
    pitch
        Of the panel [m].
    pupil
        Diameter of the iris as a fraction of the panel's band 1 / pitch, None for no iris.

    Returns
    -------
    Tensor
        The shape of ``fy`` and ``fx`` broadcast, in [0, 1], float64.
    """
    if pupil is None:
        return torch.ones_like(fy + fx, dtype=torch.float64)
    radius = torch.sqrt(fy**2 + fx**2) * (2 * pitch / pupil)
    edge = ((radius - (1 - IRIS_EDGE)) / (2 * IRIS_EDGE)).clamp(0.0, 1.0)
    return 0.5 * (1 + torch.cos(math.pi * edge))
