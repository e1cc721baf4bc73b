"""Transfer functions and the convolution by them: by the compiled kernel where there is one, by torch elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from types import ModuleType
from typing import Protocol

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from ..core.compiled import AVAILABLE
from ..core.device import LARGEST_KEPT
from .blocks import in_blocks, in_parts
from .kernel.sizes import LANES, Steps, steps

Numbers = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float32]
Axis = tuple[int, Numbers, Floats, Floats]

PARTS = 4
"""Of the kernel's work: a thread that is disturbed leaves some of it to another."""
SMALLEST_SHARED = 2**19
"""Samples of padded fields from which on two threads are quicker than one."""
NOTHING = np.empty(0, np.float32)


class TransferFunction(Protocol):
    """A transfer function on a padded ``fftfreq`` grid. shape: its rows and columns; dtype: complex."""

    shape: tuple[int, int]
    dtype: torch.dtype

    @property
    def values(self) -> Tensor:
        """``(rows, columns)``, complex; not to be written to."""

    def convolve(self, field: Tensor, conjugated: bool = False, spent: bool = False) -> Tensor:
        """The first (H, W) samples of the circular convolution of a field ``(..., H, W)``, padded with zeros.

        conjugated: by the conjugate of the transfer function, which is the adjoint; spent: the result may take the
        place of the field in memory. The field has the type and the device of the transfer function; no gradient is
        recorded.
        """


def transfer_function(values: Tensor) -> TransferFunction:
    """The transfer function of values ``(rows, columns)``, complex; for the kernel on the CPU in single precision."""
    rows, columns = (steps(size) for size in values.shape)
    fused = kernel() if values.is_cpu and values.dtype == torch.complex64 else None
    if fused is None or rows is None or columns is None:
        return InTorch(values)
    return Fused(values, rows, columns)


@cache
def kernel() -> ModuleType | None:
    """The compiled kernel; None where its compiler is not installed or does not work."""
    if not AVAILABLE:
        return None
    try:
        from .kernel import fused
    except Exception:  # whatever a compiler raises that does not know the processor, or has no folder to write to
        return None
    return fused


class Fused:
    """Convolution by the kernel; see ``fused``. Columns of zeros are left out."""

    def __init__(self, values: Tensor, rows: Steps, columns: Steps) -> None:
        self.shape, self.dtype = (values.shape[-2], values.shape[-1]), values.dtype
        self._rows, self._columns = rows, columns
        self._starts = tile_starts(values)
        self._tiles = tiled(values, self._starts)

    @property
    def values(self) -> Tensor:
        """See ``TransferFunction``; put together anew."""
        values = torch.zeros(self.shape, dtype=self.dtype, device="cpu")
        lines = torch.view_as_complex(self._tiles.permute(1, 0, 3, 2).contiguous())
        values[:, _columns_of(self._starts, self.shape[1])] = lines * values.numel()
        return values

    def convolve(self, field: Tensor, conjugated: bool = False, spent: bool = False) -> Tensor:
        """See ``TransferFunction``."""
        height, width = field.shape[-2:]
        if height > self.shape[0] or width > self.shape[1]:  # compiled code would write beyond its arrays
            raise ValueError(f"field is {(height, width)}, the transfer function {self.shape}")
        grid = Grid((1, height, width), axis(self._rows), axis(self._columns), self._starts)
        field = field.contiguous().resolve_conj().resolve_neg()
        images = field[..., 0, 0].numel()
        result, tiles = field if spent else torch.empty_like(field), grid.tiles(images)
        each = np.arange(images * len(self._starts))
        grid.spectra(field, tiles)
        grid.convolve(tiles, each, grid, tiles, each, self._tiles, conjugated)
        grid.fields(tiles, result)
        return result


def axis(steps: Steps, weights: Tensor | None = None) -> Axis:
    """An axis of a grid. weights: complex ones ``(planes, size)`` that add the spectra of planes of samples, of which
    only the ratios to the first one's count; None for one plane."""
    others = NOTHING if weights is None else _floats((weights[1:] / weights[0]).to(torch.complex64))
    return *steps, others


@dataclass(frozen=True, eq=False)
class Grid:
    """Fields ``(..., planes, planes, H, W)``, contiguous, that the kernel transforms, and the tiles of their spectra.

    The planes of a field interleave in an image of as many samples a pixel and axis; those of an image that is one
    plane of ``(n H, n W)`` lie in memory as they interleave. shape: (planes, H, W), or (1, n H, n W); rows, columns:
    axes 0 and 1 of the transforms; starts: the first column of each tile; keeps: whether there is room in a tile for
    the spectrum of its columns.
    """

    shape: tuple[int, int, int]
    rows: Axis
    columns: Axis
    starts: Numbers
    keeps: bool = False

    def tiles(self, images: int = 1) -> Tensor:
        """Room for spectra."""
        return torch.empty(images * self._size, dtype=torch.float32, device="cpu")

    def spectra(self, field: Tensor, tiles: Tensor) -> None:
        """Transform rows of a field into tiles."""
        source, target, blocks = _floats(field), tiles.numpy(), self._blocks(field)
        rows, place = _fused().rows_forward, (0, self.shape[1], self.shape, blocks)
        along = self._tile, self.starts, self.columns
        self._share(lambda *ends: rows(source, *place, *ends, target, *along), blocks, tiles)

    def spectra_of_rows(self, field: Tensor, tiles: Tensor, rows: slice) -> None:
        """``spectra`` of some rows ``(planes, planes, rows, W)``, whole blocks but the last one; by one thread."""
        planes, height, _ = self.shape
        some = np.arange(rows.start // LANES, -(-rows.stop // LANES))
        blocks = (np.arange(planes)[:, None] * -(-height // LANES) + some).ravel()
        place = rows.start, rows.stop - rows.start, self.shape
        ends, along = (0, len(blocks)), (self._tile, self.starts, self.columns)
        _fused().rows_forward(_floats(field), *place, blocks, *ends, tiles.numpy(), *along)

    def convolve(
        self, tiles: Tensor, taken: Numbers, target: Grid, to: Tensor, put: Numbers, transfer: Tensor,
        conjugated: bool, keep: bool = False, kept: tuple[Grid, Tensor, Numbers] | None = None,
    ) -> None:  # fmt: skip
        """Convolve columns by a transfer function, see ``tiled``: tiles ``taken`` into tiles ``put`` of another grid.

        keep: leave the filtered spectra in their tiles, for a grid that ``keeps``; kept: a grid and its tiles after
        that, and of each tile taken here, the one whose spectrum is added before the filter, -1 for none.
        """
        of, factors = (tiles.numpy(), self._tile, taken, self._height, self.rows), transfer.numpy().reshape(-1)
        into = to.numpy(), target._tile, put, target._height, target.rows
        grid, spectra, joins = kept or (self, tiles, np.full(len(taken), -1))
        rest = factors, np.float32(-1 if conjugated else 1), keep, spectra.numpy(), grid._tile, joins
        self._share(lambda *ends: _fused().columns(*of, *into, *ends, *rest), taken, tiles)

    def fields(self, tiles: Tensor, field: Tensor) -> None:
        """Transform what ``convolve`` left in tiles back, into a field."""
        self._back(tiles, _floats(field), NOTHING, self._blocks(field))

    def intensities(self, tiles: Tensor, light: Tensor) -> None:
        """The squared modulus of what ``fields`` would give, in ``light``, float32."""
        self._back(tiles, NOTHING, light.numpy().reshape(-1), self._blocks(light))

    def past(self, tiles: Tensor, change: Tensor, conjugated: bool, blocks: Numbers, target: Grid, to: Tensor) -> None:
        """Fields of one plane, in some blocks of rows, times complex factors, to the tiles of another grid.

        change: ``(blocks, W, 2, 16)``, real and imaginary parts of sixteen rows apart.
        """
        of, factors = (tiles.numpy(), self._tile, self.starts), change.numpy().reshape(-1)
        into = to.numpy(), target._tile, target.starts, self.shape[2], self.columns
        sign, past = np.float32(-1 if conjugated else 1), _fused().rows_past
        self._share(lambda *ends: past(*of, factors, sign, blocks, *ends, *into), blocks, tiles)

    def _back(self, tiles: Tensor, field: Floats, light: Floats, blocks: Numbers) -> None:
        source, along = tiles.numpy(), (self._tile, self.starts, self.columns)
        rows = _fused().rows_back
        self._share(lambda *ends: rows(field, light, self.shape, blocks, *ends, source, *along), blocks, tiles)

    def _blocks(self, field: Tensor) -> Numbers:
        """Numbers of the blocks of sixteen rows of all planes of all images."""
        planes, height, width = self.shape
        images = field.numel() // max(1, planes**2 * height * width)
        return np.arange(images * planes * -(-height // LANES))

    @property
    def _height(self) -> int:
        """Rows of all planes."""
        return self.shape[0] * self.shape[1]

    @cached_property
    def _tile(self) -> int:
        """Samples of a tile."""
        room = _fused().room.py_func  # as it stands there: a call of what is compiled takes longer
        return int(max(self.shape[0] * room(self.shape[1]), room(self.rows[0]) if self.keeps else 0))

    @property
    def _size(self) -> int:
        """Floats in the tiles of an image."""
        return len(self.starts) * self._tile * 2 * LANES

    def _share(self, work: Callable[[int, int], object], each: Numbers, tiles: Tensor) -> None:
        images = tiles.numel() // max(1, self._size)
        threads = torch.get_num_threads() if images * self.rows[0] * self.columns[0] >= SMALLEST_SHARED else 1
        in_parts(work, len(each), PARTS * threads if threads > 1 else 1)


def _fused() -> ModuleType:
    """The kernel, known to be there; not kept in what uses it, so that models can be copied."""
    from .kernel import fused

    return fused


def tile_starts(values: Tensor) -> Numbers:
    """First columns of the tiles of a transfer function that hold more than zeros.

    No tile reaches from low to high frequencies, but where there are few; tiles may overlap, and are equal there.
    """
    band, low = values.shape[1], (values.shape[1] + 1) // 2
    ends = [(0, low), (low, band)] if band >= 2 * LANES else [(0, LANES * -(-band // LANES))]
    starts = np.array([min(start, end - LANES) for begin, end in ends for start in range(begin, end, LANES)])
    held = (values != 0).any(0)[_columns_of(starts, band)].any(1)
    return starts[held.numpy()]


def tiled(values: Tensor, starts: Numbers) -> Tensor:
    """Tiles ``(tiles, rows, 2, 16)`` of a transfer function, real and imaginary parts apart, as the kernel takes them:
    the transforms there and back together multiply by the number of values."""
    columns = values[:, _columns_of(starts, values.shape[1])] / values.numel()
    return torch.view_as_real(columns).permute(1, 0, 3, 2).contiguous()


def _columns_of(starts: Numbers, band: int) -> Tensor:
    return torch.from_numpy(starts)[:, None].add(torch.arange(LANES, device="cpu")).clamp(max=band - 1)


def _floats(field: Tensor) -> Floats:
    return torch.view_as_real(field).numpy().reshape(-1)


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

    def convolve(self, field: Tensor, conjugated: bool = False, spent: bool = False) -> Tensor:
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
