"""A frame of the sensor in the frame of the region, differentiable: what ``Registration.rectify`` does to an image and
to its noise."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor

CUBIC = -0.75  # the constant of ``cv2.INTER_CUBIC`` and of torch's bicubic sampling


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
        """The same from pixels picked by index: its gradient is deterministic on a GPU, that of torch is not."""
        rows, columns = frame.shape
        left, top = self.x.floor() - 1, self.y.floor() - 1
        total = torch.zeros_like(self.x)
        for i, row_weight in enumerate(_weights(self.y)):
            for j, column_weight in enumerate(_weights(self.x)):
                row, column = top + i, left + j
                inside = (row >= 0) & (row <= rows - 1) & (column >= 0) & (column <= columns - 1)
                pixels = frame[row.clamp(0, rows - 1).long(), column.clamp(0, columns - 1).long()]
                total = total + row_weight * column_weight * inside * pixels
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
