"""The optical path of a bench through the compiled kernel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ...optics.sizes import LANES, steps
from ...optics.transfer import Grid, Numbers, kernel, tile_starts, tiled
from .path import LightPath, OpticalPath


def quickest(path: OpticalPath, device: torch.device) -> LightPath:
    """The path on a device: by the kernel where it can be."""
    samples = len(path.rows)
    sizes = [factor * size for size in path.transfer.shape for factor in (1, samples, path.finer)]
    ready = device.type == "cpu" and path.transfer.dtype == torch.complex64
    if kernel() is None or not ready or None in map(steps, sizes) or path.transfer.shape[1] < 2 * LANES:
        return path.to(device)
    return FusedPath(path)


@dataclass(frozen=True, eq=False)
class _Side:
    """An end of the path. grid: of its light; shared: numbers of its tiles that are tiles of the other end, too; plane:
    the plane of the dust, on the tiles of this end; transfer: from here to there or back."""

    grid: Grid
    shared: Numbers
    plane: Grid
    transfer: Tensor


class FusedPath:
    """What ``OpticalPath`` does, by the kernel.

    Interleaved sub-samples are a finer grid: one transform of ``samples`` times the size adds their spectra. Of these,
    only the band of frequencies is used that the padded grid has. The weights of sub-sample (0, 0) become part of the
    transfer function. Those of the others differ by a phase that the finer grid gives, and by a constant, ``turn``.
    """

    def __init__(self, path: OpticalPath) -> None:
        height, width = path.shape
        samples, n = len(path.rows), path.finer
        turn = (path.rows[:, 0] / path.rows[0, 0])[:, None] * (path.columns[:, 0] / path.columns[0, 0])
        self._turn = None if bool((turn == 1).all()) else turn[:, :, None, None]
        first = path.transfer * path.rows[0][:, None] * path.columns[0]
        last = torch.ones_like(first) if path.last is None else path.last
        through = first * last
        self._change, self._dusty, ends = None, np.arange(0), (through, through)
        if path.dust is not None and len(path.dust.rows):
            self._change, ends = torch.zeros(path.shape, dtype=first.dtype), (first, last)
            self._change[path.dust.rows] = path.dust.change
            self._dusty = (path.dust.rows // LANES).unique().numpy()
        starts = [tile_starts(end) for end in ends]
        common = np.intersect1d(tile_starts(through), np.intersect1d(starts[0], starts[1]))
        self._through = tiled(through, common)

        def grid(planes: int, factor: int, shape: tuple[int, int], starts: Numbers) -> Grid:
            rows, columns = (steps(factor * size) for size in through.shape)
            assert rows is not None
            assert columns is not None
            band, low = through.shape[1], (through.shape[1] + 1) // 2
            placed = np.where(starts < low, starts, starts + (factor - 1) * band)
            return Grid((planes, *shape), rows, columns, placed)

        def side(planes: int, factor: int, shape: tuple[int, int], starts: Numbers, end: Tensor) -> _Side:
            plane = grid(1, 1, path.shape, starts)
            shared = np.searchsorted(starts, common)
            factors = self._through if end is through else tiled(end, starts)
            return _Side(grid(planes, factor, shape, starts), shared, plane, factors)

        self._panel = side(samples, samples, path.shape, starts[0], ends[0])
        self._image = side(1, n, (n * height, n * width), starts[1], ends[1])

    def forward(self, field: Tensor) -> Tensor:
        """See ``LightPath``."""
        field = (field if self._turn is None else field * self._turn).to(torch.complex64)
        _, height, width = self._image.grid.shape
        return self._pass(field, self._panel, self._image, field.new_empty(height, width), conjugated=False)

    def adjoint(self, image: Tensor) -> Tensor:
        """See ``LightPath``."""
        planes, height, width = self._panel.grid.shape
        empty = image.new_empty(planes, planes, height, width)
        field = self._pass(image, self._image, self._panel, empty, conjugated=True)
        return field if self._turn is None else field.mul_(self._turn.conj())

    def _pass(self, field: Tensor, source: _Side, target: _Side, seen: Tensor, conjugated: bool) -> Tensor:
        """Light that passes the dust as if there were none, and what the dust changes of it, in ``seen``."""
        spectra, tiles = source.grid.tiles(), target.grid.tiles()
        source.grid.spectra(field.contiguous().resolve_conj().resolve_neg(), spectra, source.grid.blocks())
        if self._change is not None:
            every, other = np.arange(len(source.plane.starts)), np.arange(len(target.plane.starts))
            before, behind = source.plane.tiles(), target.plane.tiles().zero_()
            source.grid.convolve(spectra, every, source.plane, before, every, source.transfer, conjugated)
            light = torch.empty_like(self._change)
            source.plane.fields(before, light, self._dusty)
            for block in self._dusty:
                rows = slice(block * LANES, (block + 1) * LANES)
                light[rows] *= self._change[rows].conj() if conjugated else self._change[rows]
            target.plane.spectra(light, behind, self._dusty)
            target.plane.convolve(behind, other, target.grid, tiles, other, target.transfer, conjugated)
        dusty = self._change is not None
        source.grid.convolve(
            spectra, source.shared, target.grid, tiles, target.shared, self._through, conjugated, add=dusty
        )
        target.grid.fields(tiles, seen, target.grid.blocks())
        return seen
