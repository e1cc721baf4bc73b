"""The linear part of a bench, from the light of the panel's sub-samples to the field at the image plane."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import reduce
from operator import add
from typing import Any, Protocol

import torch
from torch import Tensor

from ...optics.linear import Map


class LightPath(Protocol):
    """From the sub-samples' light to the image: a linear map."""

    def forward(self, field: Tensor) -> Tensor:
        """Field ``(samples, samples, H, W)`` of the sub-samples to the image ``(n H, n W)``; differentiable once."""


Light = Callable[[slice], Tensor]
"""Some rows of the sub-samples' light: ``(samples, samples, rows, W)``, contiguous. Starts are multiples of sixteen."""


@dataclass(frozen=True, eq=False)
class OpticalPath:
    """Panel, iris, dust plane and image plane of one colour, on the padded grid, by torch: the reference for
    ``FusedPath``, in its place where it cannot be, and the way of a GPU.

    shape: of the panel; rows, columns: weights ``(samples, padded)`` that add the spectra of the sub-samples, see
    ``stages.propagation.sample_weights``; transfer: to the dust plane, or all the way where there is none; dust:
    transmission of that plane less one, ``(H, W)``; last: transfer function from there to the image; finer: samples a
    pixel and axis of the image.
    """

    shape: tuple[int, int]
    rows: Tensor
    columns: Tensor
    transfer: Tensor
    dust: Tensor | None
    last: Tensor | None
    finer: int

    def changed(self, change: Map) -> OpticalPath:
        """The same with a change of every tensor of its own."""
        own: dict[str, Any] = {name: change(value) for name, value in vars(self).items() if isinstance(value, Tensor)}
        return replace(self, **own)

    def forward(self, field: Tensor) -> Tensor:
        """See ``LightPath``."""
        height, width = (self.finer * side for side in self.shape)
        lines = _sum(torch.fft.fft(part, n=len(w)) * w for part, w in zip(field.unbind(1), self.columns, strict=True))
        spectrum = _sum(torch.fft.fft(line.mT, n=len(w)) * w for line, w in zip(lines, self.rows, strict=True)).mT
        spectrum = spectrum * self.transfer
        if self.dust is not None:
            there = torch.fft.ifft2(spectrum)[: self.shape[0], : self.shape[1]]
            spectrum = spectrum + torch.fft.fft2(there * self.dust, s=spectrum.shape)
        if self.last is not None:
            spectrum = spectrum * self.last
        seen = finer_line(spectrum.mT, self.finer)[:, :height].mT
        return finer_line(seen, self.finer)[:, :width]


def _sum(terms: Iterator[Tensor]) -> Tensor:
    return reduce(add, terms)


def finer_line(spectrum: Tensor, factor: int) -> Tensor:
    """Lines ``(..., N)`` of spectrum to lines ``(..., factor N)`` of field, with ``factor`` samples a pixel."""
    size = spectrum.shape[-1]
    low, high = spectrum.split([(size + 1) // 2, size // 2], -1)
    gap = spectrum.new_zeros((*spectrum.shape[:-1], (factor - 1) * size))
    return torch.fft.ifft(torch.cat([low, gap, high], -1)) * factor
