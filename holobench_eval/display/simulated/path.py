"""The linear part of a bench, from the light of the panel's sub-samples to the field at the image plane."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from typing import Any, Protocol

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from ...optics.blocks import in_blocks
from ...optics.phasor import squared_modulus


class LightPath(Protocol):
    """From the sub-samples' light to the image: a linear map, and its adjoint."""

    def forward(self, field: Tensor) -> Tensor:
        """Field ``(samples, samples, H, W)`` of the sub-samples to the image ``(n H, n W)``."""

    def adjoint(self, image: Tensor) -> Tensor:
        """The adjoint of ``forward``."""

    def intensity(self, light: Light) -> Tensor:
        """The squared modulus of what ``forward`` gives of all rows of a light; without a gradient."""


Light = Callable[[slice], Tensor]
"""Some rows of the sub-samples' light: ``(samples, samples, rows, W)``, contiguous. Starts are multiples of sixteen."""


def image(path: LightPath, field: Tensor) -> Tensor:
    """``path.forward``, differentiable once."""
    seen: Tensor = _Seen.apply(field, path)  # type: ignore[no-untyped-call]
    return seen


@dataclass(frozen=True, eq=False)
class Dust:
    """What specks on a plane change. rows: those of the panel that have any ``(n,)``; change: transmission less one
    ``(n, W)``; it is zero all around."""

    rows: Tensor
    change: Tensor

    @classmethod
    def of(cls, plane: Tensor) -> Dust:
        """From the plane's transmission ``(H, W)``."""
        rows = (plane != 1).any(1).nonzero().flatten()
        return cls(rows, plane[rows] - 1)


@dataclass(frozen=True, eq=False)
class OpticalPath:
    """Panel, iris, dust plane and image plane of one colour, on the padded grid, by torch: the reference for
    ``FusedPath``, in its place where it cannot be, and the way of a GPU.

    shape: of the panel; rows, columns: weights ``(samples, padded)`` that add the spectra of the sub-samples, see
    ``stages.propagation.sample_weights``; transfer: to the dust plane, or all the way where there is none; dust: what
    it changes there; last: transfer function from there to the image; finer: samples a pixel and axis of the image.
    Work is done a block of rows or columns at a time, see ``optics.convolution``: transfer functions are best stored
    column by column.

    The adjoint is written out: autograd would keep every factor's input and clear a new array for every crop.
    """

    shape: tuple[int, int]
    rows: Tensor
    columns: Tensor
    transfer: Tensor
    dust: Dust | None
    last: Tensor | None
    finer: int

    def to(self, device: torch.device) -> OpticalPath:
        """The same on a device."""
        return self.changed(lambda factor: factor.to(device))

    def changed(self, change: Callable[[Tensor], Tensor]) -> OpticalPath:
        """The same with a change of every tensor of its own, the rows of the dust among them."""
        return replace(
            self,
            rows=change(self.rows),
            columns=change(self.columns),
            transfer=change(self.transfer),
            dust=None if self.dust is None else Dust(change(self.dust.rows), change(self.dust.change)),
            last=None if self.last is None else change(self.last),
        )

    def forward(self, field: Tensor) -> Tensor:
        """Field ``(samples, samples, H, W)`` of the sub-samples to ``(finer H, finer W)``."""
        lines = row_spectra(field, self.columns)
        height, width = (self.finer * side for side in self.shape)

        def arriving(part: slice) -> Tensor:
            return column_spectra(lines, self.rows, part).mul_(self.transfer[:, part].T)

        dusty = arriving if self.dust is None else self._through(self.dust, arriving)
        seen = lines.new_empty((height, lines.shape[-1]))

        def leaving(part: slice) -> None:
            spectrum = dusty(part) if self.last is None else dusty(part).mul_(self.last[:, part].T)
            seen[:, part] = finer_line(spectrum, self.finer)[:, :height].T

        image = lines.new_empty((height, width))

        def back(rows: slice) -> None:
            image[rows] = finer_line(seen[rows], self.finer)[:, :width]

        self._each_column(leaving)
        in_blocks(back, seen, height, self.finer * seen.numel())
        return image

    def adjoint(self, image: Tensor) -> Tensor:
        """The adjoint of ``forward``, ``(finer H, finer W)`` to ``(samples, samples, H, W)``."""
        padded, height, back = self.transfer.shape, self.shape[0], self._conjugate
        seen = image.new_empty((len(image), padded[1]))

        def begin(part: slice) -> None:
            seen[part] = finer_adjoint(image[part], self.finer, padded[1])

        def returning(part: slice) -> Tensor:
            spectrum = finer_adjoint(seen[:, part].T, self.finer, padded[0])
            return spectrum if back.last is None else spectrum.mul_(back.last[:, part].T)

        in_blocks(begin, image, len(image), self.finer * seen.numel())
        dusty = returning if back.dust is None else self._through(back.dust, returning)
        lines = image.new_empty((len(back.rows), height, padded[1]))

        def leaving(part: slice) -> None:
            spectrum = dusty(part).mul_(back.transfer[:, part].T)
            for line, weights in zip(lines, back.rows, strict=True):
                line[:, part] = torch.fft.ifft(spectrum * weights, norm="forward")[:, :height].T

        self._each_column(leaving)
        return row_adjoint(lines, back.columns, self.shape[1])

    def intensity(self, light: Light) -> Tensor:
        """See ``LightPath``."""
        return squared_modulus(self.forward(light(slice(0, self.shape[0]))))

    def _through(self, dust: Dust, light: Callable[[slice], Tensor]) -> Callable[[slice], Tensor]:
        """The spectrum of a light behind the dust, or before it on the way back: a block of columns ``(block, rows)``.

        What the dust changes is added to the light, so that only rows with dust are transformed back and forth.
        """
        padded, columns = self.transfer.shape
        spectrum = dust.change.new_empty((columns, padded))
        lines = dust.change.new_empty((len(dust.rows), columns))

        def back(part: slice) -> None:
            spectrum[part] = light(part)
            lines[:, part] = torch.fft.ifft(spectrum[part])[:, dust.rows].T

        def scatter(some: slice) -> None:
            seen = torch.fft.ifft(lines[some])[:, : self.shape[1]]
            lines[some] = torch.fft.fft(seen.mul_(dust.change[some]), n=columns)

        def ahead(part: slice) -> Tensor:
            changed = torch.zeros_like(spectrum[part])
            changed[:, dust.rows] = lines[:, part].T
            return spectrum[part].add_(torch.fft.fft(changed))

        self._each_column(back)
        in_blocks(scatter, lines, len(lines), lines.numel())
        return ahead

    def _each_column(self, work: Callable[[slice], None]) -> None:
        in_blocks(work, self.transfer, self.transfer.shape[1], self.finer * self.transfer.numel())

    @cached_property
    def _conjugate(self) -> OpticalPath:
        """Formed once: a lazy conjugate is formed in every product."""
        return self.changed(conjugate)


class _Seen(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, field: Tensor, path: LightPath) -> Tensor:
        ctx.path = path
        return path.forward(field)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor, None]:
        return ctx.path.adjoint(grad), None


def conjugate(factor: Tensor) -> Tensor:
    """The complex conjugate in an array of its own."""
    return factor.conj().resolve_conj()


def row_spectra(field: Tensor, columns: Tensor) -> Tensor:
    """Spectra of rows ``(samples, H, padded)``, the sub-samples of a row joined, of ``(samples, samples, H, W)``."""
    lines = field.new_empty((field.shape[0], field.shape[2], columns.shape[1]))

    def join(rows: slice) -> None:
        for line, samples in zip(lines, field, strict=True):
            each = zip(samples, columns, strict=True)
            line[rows] = _sum(torch.fft.fft(sample[rows], n=len(weights)).mul_(weights) for sample, weights in each)

    in_blocks(join, field, field.shape[2], lines.numel() * field.shape[1])
    return lines


def column_spectra(lines: Tensor, rows: Tensor, part: slice) -> Tensor:
    """Spectrum ``(block, padded)`` of a block of columns of the panel, from the spectra of its rows."""
    each = zip(lines, rows, strict=True)
    return _sum(torch.fft.fft(line[:, part].T, n=len(weights)).mul_(weights) for line, weights in each)


def _sum(terms: Iterator[Tensor]) -> Tensor:
    """Of at least one term, in the first one's place."""
    return reduce(Tensor.add_, terms)


def row_adjoint(lines: Tensor, columns: Tensor, width: int) -> Tensor:
    """The adjoint of ``row_spectra``; columns: its weights, conjugated."""
    field = lines.new_empty((len(lines), len(columns), lines.shape[1], width))

    def part(rows: slice) -> None:
        for line, samples in zip(lines, field, strict=True):
            for sample, weights in zip(samples, columns, strict=True):
                sample[rows] = torch.fft.ifft(line[rows] * weights, norm="forward")[:, :width]

    in_blocks(part, field, lines.shape[1], lines.numel() * len(columns))
    return field


def finer_line(spectrum: Tensor, factor: int) -> Tensor:
    """Lines ``(..., N)`` of spectrum to lines ``(..., factor N)`` of field, with ``factor`` samples a pixel."""
    if factor == 1:
        return torch.fft.ifft(spectrum)
    size = spectrum.shape[-1]
    low, high = spectrum.split([(size + 1) // 2, size // 2], -1)
    gap = spectrum.new_zeros((*spectrum.shape[:-1], (factor - 1) * size))
    return torch.fft.ifft(torch.cat([low, gap, high], -1)).mul_(factor)


def finer_adjoint(lines: Tensor, factor: int, size: int) -> Tensor:
    """The adjoint of ``finer_line`` and a crop, ``(..., up to factor size)`` to ``(..., size)``."""
    fine = torch.fft.fft(lines, n=factor * size, norm="forward").mul_(factor)
    low, high = (size + 1) // 2, size // 2
    return fine if factor == 1 else torch.cat([fine[..., :low], fine[..., factor * size - high :]], -1)
