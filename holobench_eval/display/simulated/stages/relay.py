"""The relay carries the image to the sensor, magnified, turned and a little distorted (paper 5.1)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

import torch
import torch.nn.functional as F  # noqa: N812
from annotated_types import Interval
from torch import Tensor

from ....core.compiled import usable
from ...resampling import picked
from ..kernels import sample_rows
from ..maps import enlarged
from ..stage import Effect, Stage

if TYPE_CHECKING:
    from ..profile import Profile


@dataclass(frozen=True)
class Relay(Stage):
    """Pose of the panel's image on the sensor.

    magnification: of the image on the sensor [1]; rotation: of the image [degrees]; shift: rows and columns [panel
    heights]; perspective: change of scale over the picture, vertical and horizontal [1/panel height]; distortion:
    radial displacement at half a panel height [relative to it].
    """

    title: ClassVar[str] = "relay"
    model: ClassVar[str] = "magnification, rotation, shift, perspective, radial distortion (paper 5.1)"

    magnification: Annotated[float, Interval(gt=0, le=10)] = 1.0
    rotation: Annotated[float, Interval(ge=-180, le=180)] = 0.0
    shift: tuple[float, float] = (0.0, 0.0)
    perspective: tuple[float, float] = (0.0, 0.0)
    distortion: Annotated[float, Interval(ge=-0.2, le=0.2)] = 0.0

    def effects(self, profile: Profile) -> Iterator[Effect]:
        """The pose."""
        if "moved" in self.maps:
            displacement = float(self.maps["moved"].square().sum(0).mean().sqrt())
            yield Effect("pose", f"picture displaced by {displacement:.2g} px rms, as measured")
        elif self.rotation or any(self.shift) or any(self.perspective) or self.distortion:
            yield Effect("pose", "pose of the camera, what registration leaves of it and its interpolation")

    def frame_shape(self, window: tuple[int, int], pitch: float, sensor_pitch: float) -> tuple[int, int]:
        """Sensor read-out (rows, columns) for a window of the panel [px], with a margin of 12 % for the pose."""
        ratio = self.magnification * pitch / sensor_pitch
        return math.ceil(window[0] * ratio * 1.12), math.ceil(window[1] * ratio * 1.12)

    def panel_points(
        self, shape: tuple[int, int], pitch: float, sensor_pitch: float, window: tuple[int, int] | None = None
    ) -> Tensor:
        """Panel coordinates (row, column) [px] seen by every sensor pixel, ``(Hs, Ws, 2)`` float64.

        window: the part of the panel, in its middle, that is read out (all of it by default).
        """
        rows, columns = self.frame_shape(window or shape, pitch, sensor_pitch)
        ratio = self.magnification * pitch / sensor_pitch * shape[0]
        v = ((torch.arange(rows, dtype=torch.float64) - (rows - 1) / 2) / ratio - self.shift[0])[:, None]
        u = ((torch.arange(columns, dtype=torch.float64) - (columns - 1) / 2) / ratio - self.shift[1])[None, :]
        turn = math.radians(self.rotation)
        y = math.cos(turn) * v - math.sin(turn) * u
        x = math.sin(turn) * v + math.cos(turn) * u
        depth = 1 + self.perspective[0] * y + self.perspective[1] * x
        y, x = y / depth, x / depth
        stretch = 1 + self.distortion * 4 * (y * y + x * x)
        row = y * stretch * shape[0] + (shape[0] - 1) / 2
        column = x * stretch * shape[0] + (shape[1] - 1) / 2
        return torch.stack([row, column], dim=-1)

    def displaced(self, points: Tensor, shape: tuple[int, int]) -> Tensor:
        """Panel coordinates ``(Hs, Ws, 2)`` [px] where the picture is that was displaced on its way; linear between
        pixels, of whose displacement a map has rows and columns."""
        if "moved" not in self.maps:
            return points
        moved = torch.stack([enlarged(each, shape) for each in self.maps["moved"]])
        grid = sampling_grid(points, shape).double()[None]
        return points + F.grid_sample(moved[None], grid, padding_mode="border", align_corners=True)[0].permute(1, 2, 0)


def sampling_grid(points: Tensor, shape: tuple[int, int]) -> Tensor:
    """Points ``(Hs, Ws, 2)`` (row, column) in pixels of a panel of ``shape``, as ``grid_sample`` wants them, float32.

    -1 and 1 are the centres of the first and the last pixel.
    """
    size = torch.tensor(shape, dtype=torch.float64)
    return (2 * points / (size - 1) - 1).flip(-1).float()


def finer_grid(grid: Tensor, shape: Sequence[int], per_pixel: int) -> Tensor:
    """A ``sampling_grid`` for an image of ``shape``, sampled ``per_pixel`` times a pixel.

    The finer samples start at the first pixel's centre and go on past the last one's; the grid is scaled for that.
    """
    if per_pixel == 1:
        return grid
    rows, columns = shape
    pixels = grid.new_tensor([columns / per_pixel - 1, rows / per_pixel - 1])
    return (grid + 1) * (pixels * per_pixel / grid.new_tensor([columns - 1.0, rows - 1.0])) - 1


def sample(image: Tensor, grid: Tensor, per_pixel: int) -> Tensor:
    """Bilinear values of an image ``(H, W)``, sampled ``per_pixel`` times a pixel, at a ``sampling_grid``."""
    fine = finer_grid(grid, image.shape, per_pixel)
    if usable(image):
        seen = torch.empty(grid.shape[:2], dtype=torch.float32, device="cpu")
        sample_rows(image.detach().contiguous().numpy(), fine.contiguous().numpy(), seen.numpy())
        return seen
    if image.requires_grad and not image.is_cpu:
        return gathered(image, fine)
    return F.grid_sample(image[None, None], fine[None], mode="bilinear", padding_mode="zeros", align_corners=True)[0, 0]


def gathered(image: Tensor, grid: Tensor) -> Tensor:
    """What ``grid_sample`` gives for an image ``(H, W)``, see ``picked``."""
    x, y = ((grid[..., axis] + 1) / 2 * (image.shape[1 - axis] - 1) for axis in (0, 1))
    rows, columns = ([(at.floor() + k, 1 - (at - (at.floor() + k)).abs()) for k in (0, 1)] for at in (y, x))
    return picked(image, rows, columns)
