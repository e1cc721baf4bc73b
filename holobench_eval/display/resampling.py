"""A frame of the sensor in the frame of the region, differentiable: what ``Registration.rectify`` does to an image and
to its noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor

CUBIC = -0.75  # the constant of ``cv2.INTER_CUBIC`` and of torch's bicubic sampling
Weighted = Sequence[tuple[Tensor, Tensor]]
"""Places along an axis, and their weights."""


@dataclass(frozen=True, eq=False)
class Resampling:
    """Cubic interpolation of frames at fixed places.

    Parameters
    ----------
    x, y
        Places [sensor px], each ``(h, w)``.
    """

    x: Tensor
    y: Tensor

    def __call__(self, frame: Tensor) -> Tensor:
        """A frame ``(Hs, Ws)`` at the places, ``(h, w)``, zero outside of it; differentiable in the frame."""
        if not frame.is_cpu:
            return self._gathered(frame)
        rows, columns = frame.shape
        grid = torch.stack([2 * self.x / (columns - 1) - 1, 2 * self.y / (rows - 1) - 1], dim=-1)
        at = {"mode": "bicubic", "padding_mode": "zeros", "align_corners": True}
        return F.grid_sample(frame[None, None], grid[None], **at)[0, 0]  # type: ignore[arg-type]

    @cached_property
    def noise_gain(self) -> Tensor:
        """Variance of the interpolated over that of a pixel, ``(h, w)``, of noise that is independent in each pixel."""
        return _weights(self.y).square().sum(0) * _weights(self.x).square().sum(0)

    def _gathered(self, frame: Tensor) -> Tensor:
        rows, columns = ([(at.floor() - 1 + i, w) for i, w in enumerate(_weights(at))] for at in (self.y, self.x))
        return picked(frame, rows, columns)


def picked(image: Tensor, rows: Weighted, columns: Weighted) -> Tensor:
    """Weighted sums of pixels of an image ``(H, W)``, zero outside of it, each of some rows and of some columns.

    Pixels are picked by index: the gradient is deterministic on a GPU, where that of torch's sampling is not.
    """
    height, width = image.shape
    total = torch.zeros_like(rows[0][0])
    for (row, down), (column, along) in product(rows, columns):
        inside = (row >= 0) & (row <= height - 1) & (column >= 0) & (column <= width - 1)
        total = (
            total + down * along * inside * image[row.clamp(0, height - 1).long(), column.clamp(0, width - 1).long()]
        )
    return total


def _weights(at: Tensor) -> Tensor:
    """Weights ``(4, ...)`` of the pixels around places; Keys, IEEE Trans. ASSP 29(6), 1153 (1981), Eq. 4."""
    fraction = at - at.floor()
    return torch.stack([_far(1 + fraction), _near(fraction), _near(1 - fraction), _far(2 - fraction)])


def _near(distance: Tensor) -> Tensor:
    """The weight of a pixel at most one away."""
    return ((CUBIC + 2) * distance - (CUBIC + 3)) * distance**2 + 1


def _far(distance: Tensor) -> Tensor:
    """The weight of a pixel one to two away."""
    return CUBIC * (((distance - 5) * distance + 8) * distance - 4)
