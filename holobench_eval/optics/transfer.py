"""Transfer functions and the convolution by them: by the compiled kernel where there is one, by torch elsewhere."""

from __future__ import annotations

from functools import cache, cached_property
from types import ModuleType
from typing import Protocol

import numpy as np
import torch
from torch import Tensor

from ..core.allocator import LARGEST_KEPT
from .blocks import in_blocks, in_parts
from .sizes import Steps, steps

PARTS = 4
"""Of the kernel's work: a thread that is disturbed leaves some of it to another."""
SMALLEST_SHARED = 2**19
"""Samples of padded fields from which on two threads are quicker than one."""


class TransferFunction(Protocol):
    """A transfer function on a padded ``fftfreq`` grid. shape: its rows and columns; dtype: complex."""

    shape: tuple[int, int]
    dtype: torch.dtype

    @property
    def values(self) -> Tensor:
        """``(rows, columns)``, complex; not to be written to."""

    def convolve(self, field: Tensor, conjugated: bool = False) -> Tensor:
        """The first (H, W) samples of the circular convolution of a field ``(..., H, W)``, padded with zeros.

        conjugated: by the conjugate of the transfer function, which is the adjoint. The field has the type and the
        device of the transfer function; no gradient is recorded.
        """


def transfer_function(values: Tensor) -> TransferFunction:
    """The transfer function of values ``(rows, columns)``, complex; for the kernel on the CPU in single precision."""
    rows, columns = (steps(size) for size in values.shape)
    fused = kernel() if values.is_cpu and values.dtype == torch.complex64 else None
    if fused is None or rows is None or columns is None:
        return InTorch(values)
    return Fused(fused, values, rows, columns)


@cache
def kernel() -> ModuleType | None:
    """The compiled kernel; None where its compiler is not installed or does not work."""
    try:
        from . import fused
    except (ImportError, OSError, RuntimeError):  # whatever a compiler raises that does not know the processor
        return None
    return fused


class Fused:
    """Convolution by the kernel; see ``fused``. Columns of zeros are left out."""

    def __init__(self, fused: ModuleType, values: Tensor, rows: Steps, columns: Steps) -> None:
        self.shape, self.dtype = (values.shape[-2], values.shape[-1]), values.dtype
        self._fused, self._rows, self._columns = fused, rows, columns
        height, width = self.shape
        self._blocks = -(-width // fused.LANES)
        padded = torch.nn.functional.pad(values / values.numel(), (0, self._blocks * fused.LANES - width))
        tiles = torch.view_as_real(padded).view(height, self._blocks, fused.LANES, 2).permute(1, 0, 3, 2)
        kept = (tiles.abs().amax((1, 2, 3)) > 0).nonzero().flatten()
        self._kept, self._tiles = kept.numpy(), tiles[kept].contiguous()

    @property
    def values(self) -> Tensor:
        """See ``TransferFunction``; put together anew."""
        height, width = self.shape
        tiles = self._tiles.new_zeros((self._blocks, *self._tiles.shape[1:]))
        tiles[self._kept] = self._tiles * (height * width)
        rows = tiles.permute(1, 0, 3, 2).contiguous()
        return torch.view_as_complex(rows).view(height, -1)[:, :width]

    def convolve(self, field: Tensor, conjugated: bool = False) -> Tensor:
        """See ``TransferFunction``."""
        fused, (height, width) = self._fused, field.shape[-2:]
        field = field.contiguous().resolve_conj()
        result = torch.empty_like(field)
        images, kept = field[..., 0, 0].numel(), len(self._kept)
        tiles = torch.empty(images * kept * fused.room(height) * fused.SAMPLE).numpy()
        source, target = (torch.view_as_real(each).numpy().reshape(-1) for each in (field, result))
        transfer, sign = self._tiles.numpy().reshape(-1), np.float32(-1 if conjugated else 1)
        rows = height, width
        along = self._kept, self.shape[1], *self._columns
        across = transfer, sign, self.shape[0], *self._rows
        blocks = images * -(-height // fused.LANES)
        threads = torch.get_num_threads() if images * self.shape[0] * self.shape[1] >= SMALLEST_SHARED else 1
        parts = PARTS * threads if threads > 1 else 1

        in_parts(lambda *ends: fused.rows_forward(source, *rows, *ends, tiles, *along), blocks, parts)
        in_parts(lambda *ends: fused.columns(tiles, height, *ends, *across), images * kept, parts)
        in_parts(lambda *ends: fused.rows_back(tiles, *rows, *ends, target, *along), blocks, parts)
        return result


class InTorch:
    """Convolution by torch: the reference for the kernel, in its place where it cannot be, and the way of a GPU."""

    def __init__(self, values: Tensor) -> None:
        self.shape, self.dtype = (values.shape[-2], values.shape[-1]), values.dtype
        self._large = values.is_cpu and values.numel() * values.element_size() > LARGEST_KEPT
        self.values = by_columns(values) if self._large else values

    @cached_property
    def _conjugate(self) -> Tensor:
        """Formed once, but for large ones: it would take as much memory as all the rest of a propagation."""
        conjugate = self.values.conj()
        return conjugate if self._large else conjugate.resolve_conj()

    def convolve(self, field: Tensor, conjugated: bool = False) -> Tensor:
        """See ``TransferFunction``."""
        height, width = field.shape[-2:]
        transfer = self._conjugate if conjugated else self.values
        if self._large:
            return _convolve_pruned(field, transfer)
        return torch.fft.ifft2(torch.fft.fft2(field, s=self.shape).mul_(transfer))[..., :height, :width]


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


def by_columns(values: Tensor) -> Tensor:
    """The same transfer function ``(rows, columns)``, each column contiguous in memory."""
    return values.T.contiguous().T
