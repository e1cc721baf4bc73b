"""The linear part of a bench, from the light of the panel's sub-samples to the field at the image plane."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from ..optics.convolution import multiply


@dataclass(frozen=True, eq=False)
class OpticalPath:
    """Panel, iris, dust plane and image plane of one colour, on the padded grid.

    shape: of the panel; rows, columns: weights ``(samples, padded)`` that add the spectra of the sub-samples, see
    ``stages.propagation.sample_weights``; still: spectrum of the light that no phase changes; transfer: to the dust
    plane, or all the way where there is none; plane: its transmission; last: transfer function from there to the image;
    finer: samples a pixel and axis of the image.

    The adjoint is written out: autograd would keep every factor's input and clear a new array for every crop.
    """

    shape: tuple[int, int]
    rows: Tensor
    columns: Tensor
    still: Tensor
    transfer: Tensor
    plane: Tensor | None
    last: Tensor | None
    finer: int

    def image(self, field: Tensor) -> Tensor:
        """Field ``(samples, samples, H, W)`` of the sub-samples to ``(finer H, finer W)``; differentiable once."""
        seen: Tensor = _Seen.apply(field, self)  # type: ignore[no-untyped-call]
        return seen

    def forward(self, field: Tensor) -> Tensor:
        """``image`` for the light that follows the phase and the light that does not."""
        spectrum = multiply(panel_spectrum(field, self.rows, self.columns).add_(self.still), self.transfer)
        if self.plane is not None and self.last is not None:
            spectrum = multiply(torch.fft.fft2(multiply(torch.fft.ifft2(spectrum), self.plane)), self.last)
        return finer_field(spectrum, self.finer, self.shape)

    def adjoint(self, image: Tensor) -> Tensor:
        """The adjoint of the linear part of ``forward``, ``(finer H, finer W)`` to ``(samples, samples, H, W)``."""
        rows, columns, transfer, plane, last = self._conjugates
        spectrum = finer_adjoint(image, self.finer, self.transfer.shape[-2:])
        if plane is not None and last is not None:
            field = torch.fft.ifft2(multiply(spectrum, last), norm="forward")
            spectrum = torch.fft.fft2(multiply(field, plane), norm="forward")
        return panel_adjoint(multiply(spectrum, transfer), rows, columns, self.shape)

    @cached_property
    def _conjugates(self) -> tuple[Tensor, Tensor, Tensor, Tensor | None, Tensor | None]:
        """Formed once: a lazy conjugate is formed in every product."""
        return (
            conjugate(self.rows),
            conjugate(self.columns),
            conjugate(self.transfer),
            None if self.plane is None else conjugate(self.plane),
            None if self.last is None else conjugate(self.last),
        )


class _Seen(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, field: Tensor, path: OpticalPath) -> Tensor:
        ctx.path = path
        return path.forward(field)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor, None]:
        return ctx.path.adjoint(grad), None


def conjugate(factor: Tensor) -> Tensor:
    """The complex conjugate in an array of its own."""
    return factor.conj().resolve_conj()


def panel_spectrum(field: Tensor, rows: Tensor, columns: Tensor) -> Tensor:
    """Spectrum of the panel on the padded grid, from the field ``(samples, samples, H, W)`` of its sub-samples.

    Axis by axis, so that the sub-samples of a row are one array before the columns are transformed.
    """
    total = torch.zeros(())
    for line, row in zip(field, rows, strict=True):
        joined = torch.zeros(())
        for samples, column in zip(line, columns, strict=True):
            joined = multiply(torch.fft.fft(samples, n=len(column)), column).add_(joined)
        total = multiply(torch.fft.fft(joined, n=len(row), dim=-2), row[:, None]).add_(total)
    return total


def panel_adjoint(spectrum: Tensor, rows: Tensor, columns: Tensor, shape: tuple[int, int]) -> Tensor:
    """The adjoint of ``panel_spectrum``; rows and columns: its weights, conjugated."""
    height, width = shape
    field = spectrum.new_empty((len(rows), len(columns), height, width))
    for line, row in zip(field, rows, strict=True):
        joined = torch.fft.ifft(spectrum * row[:, None], dim=-2, norm="forward")[:height]
        for samples, column in zip(line, columns, strict=True):
            samples.copy_(torch.fft.ifft(joined * column, norm="forward")[:, :width])
    return field


def finer_field(spectrum: Tensor, factor: int, shape: tuple[int, int]) -> Tensor:
    """The first ``shape`` pixels of the field of a spectrum, with ``factor`` samples a pixel and axis.

    Each axis is transformed with zeros between its positive and negative frequencies, and cropped before the next.
    """
    spectrum = spectrum * factor**2
    for dim in (-1, -2):
        size = spectrum.shape[dim]
        low, high = spectrum.split([(size + 1) // 2, size // 2], dim)
        gap = list(spectrum.shape)
        gap[dim] *= factor - 1
        padded = torch.cat([low, spectrum.new_zeros(gap), high], dim)
        spectrum = torch.fft.ifft(padded, dim=dim).narrow(dim, 0, shape[dim] * factor)
    return spectrum


def finer_adjoint(image: Tensor, factor: int, padded: tuple[int, ...]) -> Tensor:
    """The adjoint of ``finer_field``, to a spectrum of the shape ``padded``."""
    spectrum = image * factor**2
    for dim in (-2, -1):
        size = padded[dim]
        fine = torch.fft.fft(spectrum, n=size * factor, dim=dim, norm="forward")
        low, high = (size + 1) // 2, size // 2
        spectrum = torch.cat([fine.narrow(dim, 0, low), fine.narrow(dim, size * factor - high, high)], dim)
    return spectrum
