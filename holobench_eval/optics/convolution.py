"""The common form of the near-field propagators: pad, transform, multiply, transform back, crop."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any, Protocol

import torch
from torch import Tensor

from ..core.allocator import LARGEST_KEPT
from .blocks import in_blocks
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
    """A shift-invariant propagator given by its transfer function.

    The field sits in the corner of the padded array, so no shifts are needed; the transfer function carries
    no constant phase exp(ikz).

    Parameters
    ----------
    shape
        Rows and columns of the fields.
    transfer
        Transfer function on the padded ``fftfreq`` grid, complex.
    """

    def __init__(self, shape: tuple[int, int], transfer: Tensor) -> None:
        self.shape = shape
        self.transfer = transfer

    @property
    def padded_shape(self) -> tuple[int, int]:
        """(rows, columns) of the transform."""
        return self.transfer.shape[-2], self.transfer.shape[-1]

    def blank(self, *batch: int) -> Tensor:
        """A dark field for ``convolve``, ``(*batch, H, W)``, or padded where ``convolve`` would pad it."""
        shape = self.shape if is_large(self.transfer) else self.padded_shape
        return self.transfer.new_zeros((*batch, *shape))

    def forward(self, field: Tensor) -> Tensor:
        """Propagate ``(..., H, W)`` complex to ``(..., H, W)``; differentiable."""
        return self._convolve(field, conjugated=False)

    def adjoint(self, field: Tensor) -> Tensor:
        """The adjoint of ``forward``; for a pure phase transfer function this propagates back."""
        return self._convolve(field, conjugated=True)

    @cached_property
    def conjugate(self) -> Tensor:
        """The transfer function of the adjoint; formed once, but for large ones: there a block of it is formed at a
        time, since it would take as much memory as all the rest of a propagation."""
        conjugate = self.transfer.conj()
        return conjugate if is_large(conjugate) else conjugate.resolve_conj()

    def _convolve(self, field: Tensor, conjugated: bool) -> Tensor:
        if tuple(field.shape[-2:]) != self.shape:
            raise ValueError(f"field is {tuple(field.shape[-2:])}, the propagator was made for {self.shape}")
        field = field.to(torch.promote_types(field.dtype, self.transfer.dtype))
        convolved: Tensor = _Convolved.apply(field, self, conjugated)  # type: ignore[no-untyped-call]
        return convolved


class _Convolved(torch.autograd.Function):
    """The gradient of a convolution is its adjoint; recorded operations would keep every padded array."""

    @staticmethod
    def forward(ctx: Any, field: Tensor, model: Convolution, conjugated: bool) -> Tensor:
        ctx.model, ctx.conjugated = model, conjugated
        return convolve(field, model.conjugate if conjugated else model.transfer)

    @staticmethod
    def backward(ctx: Any, *grad: Tensor) -> tuple[Tensor, None, None]:
        returned: Tensor = _Convolved.apply(grad[0], ctx.model, not ctx.conjugated)  # type: ignore[no-untyped-call]
        return returned, None, None


def convolve(field: Tensor, transfer: Tensor) -> Tensor:
    """The first (H, W) samples of the circular convolution of a field ``(..., H, W)``, padded with zeros.

    A field that is padded already stays so: of what is returned, only the panel's part is free of wrapped light.
    """
    height, width = field.shape[-2:]
    padded = transfer.shape
    if not is_large(transfer):
        return torch.fft.ifft2(torch.fft.fft2(field, s=padded).mul_(transfer))[..., :height, :width]
    return _convolve_pruned(field, transfer)


def _convolve_pruned(field: Tensor, transfer: Tensor) -> Tensor:
    """``convolve`` without the padded array.

    Rows are transformed before there are padded ones, and cropped ones are not transformed back. All is done a block
    of rows or columns at a time, and columns are made contiguous for it.
    """
    height, width = field.shape[-2:]
    padded = transfer.shape
    spectrum = field.new_empty((*field.shape[:-1], padded[1]))

    def transform(rows: slice) -> None:
        spectrum[..., rows, :] = torch.fft.fft(field[..., rows, :], n=padded[1])

    def filtered(columns: slice) -> None:
        column = torch.fft.fft(spectrum[..., columns].transpose(-1, -2), n=padded[0])
        column = torch.fft.ifft(column.mul_(transfer[:, columns].T))
        spectrum[..., columns] = column[..., :height].transpose(-1, -2)

    def transform_back(rows: slice) -> None:
        spectrum[..., rows, :width] = torch.fft.ifft(spectrum[..., rows, :])[..., :width]

    in_blocks(transform, spectrum, height, spectrum.numel())
    in_blocks(filtered, spectrum, padded[1], spectrum.numel() // height * padded[0])
    in_blocks(transform_back, spectrum, height, spectrum.numel())
    return spectrum[..., :width]


def is_large(transfer: Tensor) -> bool:
    """Whether arrays of this size come from the system each time, page by page, which takes longer than a transform of
    them: they are avoided where it can be done. See ``allocator``."""
    return transfer.is_cpu and transfer.numel() * transfer.element_size() > LARGEST_KEPT


def as_used(transfer: Tensor) -> Tensor:
    """The same transfer function ``(rows, columns)``, each column contiguous in memory if it is a large one."""
    return by_columns(transfer) if is_large(transfer) else transfer


def by_columns(transfer: Tensor) -> Tensor:
    """The same transfer function ``(rows, columns)``, each column contiguous in memory."""
    return transfer.T.contiguous().T


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
