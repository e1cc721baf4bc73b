"""The optical path of a bench through the compiled kernel."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ...optics.blocks import in_blocks
from ...optics.kernel.sizes import LANES, steps
from ...optics.linear import linear
from ...optics.transfer import Grid, Numbers, axis, kernel, tile_starts, tiled
from .path import Light, LightPath, OpticalPath


def quickest(path: OpticalPath, device: torch.device) -> LightPath:
    """The path on a device: by the kernel where it can be."""
    ready = device.type == "cpu" and path.transfer.dtype == torch.complex64
    if kernel() is None or not ready or None in map(steps, path.transfer.shape) or path.transfer.shape[1] < 2 * LANES:
        return path.changed(lambda factor: factor.to(device))
    return FusedPath(path)


@dataclass(frozen=True, eq=False)
class _Side:
    """An end of the path. grid: of its light; shared: numbers of its tiles that are tiles of the other end, too;
    others: for each of its tiles, the number of that of the other end, or -1; plane: the plane of the dust, on the
    tiles of this end; transfer: from here to there or back."""

    grid: Grid
    shared: Numbers
    others: Numbers
    plane: Grid
    transfer: Tensor


class FusedPath:
    """What ``OpticalPath`` does, by the kernel.

    The weights of the first sub-sample become part of the transfer function. Finer samples of the image are planes that
    interleave, as the sub-samples are: each is the same spectrum, shifted.
    """

    def __init__(self, path: OpticalPath) -> None:
        height, width = path.shape
        n = path.finer
        first = path.transfer * path.rows[0][:, None] * path.columns[0]
        last = torch.ones_like(first) if path.last is None else path.last
        through = first * last
        self._change, self._dusty, ends = None, np.arange(0), (through, through)
        if path.dust is not None and path.dust.any():
            self._dusty = (path.dust.any(1).nonzero().flatten() // LANES).unique().numpy()
            # Both ends' transforms are divided by their size in ``first`` alone: the light that passes meets it once.
            change = first.new_zeros(LANES * -(-height // LANES), width)
            change[:height] = path.dust / first.numel()
            lanes = torch.view_as_real(change.view(-1, LANES, width)[self._dusty]).permute(0, 2, 3, 1)
            self._change, ends = lanes.contiguous(), (first, last * first.numel())
        starts = [tile_starts(end) for end in ends]
        rows, columns = (steps(size) for size in through.shape)
        assert rows is not None
        assert columns is not None
        shift = [finer_weights(size, n) for size in through.shape]

        def side(planes: int, finer: int, weights: Sequence[Tensor], end: int) -> _Side:
            here, there = starts[end], starts[1 - end]
            axes, shape = (axis(rows, weights[0]), axis(columns, weights[1])), (planes, finer * height, finer * width)
            common = np.isin(here, there)
            others = np.where(common, np.searchsorted(there, here), -1)
            plane = Grid((1, height, width), axis(rows), axis(columns), here)
            grid = Grid(shape, *axes, here, keeps=self._change is not None)
            return _Side(grid, np.flatnonzero(common), others, plane, tiled(ends[end], here))

        self._panel = side(len(path.rows), 1, (path.rows, path.columns), 0)
        self._image = side(1, n, shift, 1)

    def forward(self, field: Tensor) -> Tensor:
        """See ``LightPath``."""
        return linear(self._ahead, self.adjoint, field)

    def _ahead(self, field: Tensor) -> Tensor:
        source, target = self._panel, self._image
        tiles = self._pass(_spectra(source.grid, field.to(torch.complex64)), source, target, conjugated=False)
        seen = field.new_empty(target.grid.shape[1:], dtype=torch.complex64)
        target.grid.fields(tiles, seen)
        return seen

    def adjoint(self, image: Tensor) -> Tensor:
        """The adjoint of ``forward``."""
        source, target = self._image, self._panel
        tiles = self._pass(_spectra(source.grid, image), source, target, conjugated=True)
        planes, height, width = target.grid.shape
        field = image.new_empty(planes, planes, height, width)
        target.grid.fields(tiles, field)
        return field

    def intensity(self, light: Light) -> Tensor:
        """The squared modulus of what ``forward`` gives of all rows of a light, without a gradient: the light of a few
        rows is transformed while it is in the cache."""
        spectra, grid = self._panel.grid.tiles(), self._panel.grid
        planes, height, width = grid.shape
        blocks = -(-height // LANES)

        def transform(some: slice) -> None:
            rows = slice(some.start * LANES, min(some.stop * LANES, height))
            grid.spectra_of_rows(light(rows), spectra, rows)

        in_blocks(transform, spectra, blocks, 2 * planes**2 * height * width)
        tiles = self._pass(spectra, self._panel, self._image, conjugated=False)
        seen = torch.empty(self._image.grid.shape[1:], dtype=torch.float32, device="cpu")
        self._image.grid.intensities(tiles, seen)
        return seen

    def _pass(self, spectra: Tensor, source: _Side, target: _Side, conjugated: bool) -> Tensor:
        """Light from one end, in the tiles of the other; dust adds what it changes to the light's spectrum."""
        tiles = target.grid.tiles()
        if self._change is None:
            source.grid.convolve(spectra, source.shared, target.grid, tiles, target.shared, source.transfer, conjugated)
            return tiles
        every, other = np.arange(len(source.plane.starts)), np.arange(len(target.plane.starts))
        before, behind = source.plane.tiles(), target.plane.tiles().zero_()
        source.grid.convolve(spectra, every, source.plane, before, every, source.transfer, conjugated, keep=True)
        source.plane.past(before, self._change, conjugated, self._dusty, target.plane, behind)
        kept = source.grid, spectra, target.others
        target.plane.convolve(behind, other, target.grid, tiles, other, target.transfer, conjugated, kept=kept)
        return tiles


def _spectra(grid: Grid, field: Tensor) -> Tensor:
    tiles = grid.tiles()
    grid.spectra(field.contiguous().resolve_conj().resolve_neg(), tiles)
    return tiles


def finer_weights(size: int, factor: int) -> Tensor:
    """Of the spectra of interleaving planes of samples, ``(factor, size)``, that make up that of a finer line."""
    shift = torch.arange(factor, dtype=torch.float64, device="cpu")[:, None] / factor
    angle = -2 * math.pi * shift * torch.fft.fftfreq(size, dtype=torch.float64, device="cpu")
    return torch.polar(torch.ones_like(angle), angle)
