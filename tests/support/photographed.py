"""Made-up photographs of a display: a picture through a known homography, with speckle, vignetting and noise."""

import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from skimage import data

from holobench_eval.metrics import score
from holobench_eval.testing.grid_poses import corner_points as corners

Array = NDArray[np.float64]
Picture = NDArray[np.float32]


def photograph(name: str, size: tuple[int, int] = (320, 400)) -> Picture:
    """One of scikit-image's photographs as ``(3, h, w)`` in [0, 1], stretched to a size (rows, columns)."""
    picture = np.asarray(getattr(data, name)(), dtype=np.float32) / 255
    colour = picture[..., :3] if picture.ndim == 3 else np.repeat(picture[..., None], 3, axis=2)
    return np.ascontiguousarray(cv2.resize(colour, size[::-1], interpolation=cv2.INTER_AREA).transpose(2, 0, 1))


def few(*pictures: Any, **options: Any) -> dict[str, float]:
    """The scores of the two metrics that are quick."""
    return score(*pictures, **{**options, "metrics": ("psnr", "ssim")})


def save(path: Path, picture: Picture) -> None:
    """Write ``(1 or 3, h, w)`` in [0, 1] as levels of 8 bits; the name's ending chooses the format."""
    path.parent.mkdir(parents=True, exist_ok=True)
    levels = np.round(picture * 255).astype(np.uint8)
    Image.fromarray(levels[0] if len(levels) == 1 else levels.transpose(1, 2, 0)).save(path)


def pose(
    draw: np.random.Generator,
    shape: tuple[int, int],
    scale: float = 1.4,
    turns: int = 0,
    mirrored: bool = False,
    perspective: float = 0.02,
    tilt: float = 4.0,
    room: float = 1.25,
) -> tuple[Array, tuple[int, int]]:
    """A homography ``(3, 3)`` from target to capture, and the capture's size: ``room`` times what the target takes."""
    height, width = shape
    angle = math.radians(90 * turns + draw.uniform(-tilt, tilt))
    centre = np.array([[1, 0, -(width - 1) / 2], [0, 1, -(height - 1) / 2], [0, 0, 1.0]])
    mirror = np.diag([-1.0 if mirrored else 1.0, 1, 1])
    turn = np.array([[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1]])
    lean = np.eye(3)
    lean[2, :2] = draw.uniform(-perspective, perspective, 2) / max(shape)
    place = np.diag([scale, scale, 1.0]) @ lean @ turn @ mirror @ centre
    ends = mapped(place, corners(shape))
    low, high = ends.min(axis=0), ends.max(axis=0)
    size = np.ceil((high - low) * room).astype(int)
    shift = np.eye(3)
    shift[:2, 2] = -low + (size - 1 - (high - low)) * draw.uniform(0.2, 0.8, 2)
    return shift @ place, (int(size[1]), int(size[0]))


def mapped(homography: Array, points: Array) -> Array:
    moved = np.column_stack([points, np.ones(len(points))]) @ homography.T
    return moved[:, :2] / moved[:, 2:]


def captured(
    picture: Picture,
    homography: Array,
    size: tuple[int, int],
    draw: np.random.Generator,
    contrast: float = 0.5,
    grain: float = 1.0,
    vignetting: float = 0.4,
    noise: float = 0.01,
) -> Picture:
    """What a camera stores of a displayed picture ``(3, h, w)``: speckled light, then a gamma of 2.2."""
    scale = math.sqrt(abs(np.linalg.det(homography[:2, :2])))
    light = np.clip(picture, 0, 1).astype(np.float32) ** 2.2
    if scale < 1:
        light = np.stack([cv2.GaussianBlur(plane, (0, 0), 0.4 / scale) for plane in light])
    seen = np.stack([cv2.warpPerspective(plane, homography, size[::-1], flags=cv2.INTER_CUBIC) for plane in light])
    y, x = (np.linspace(-1, 1, side) for side in size)
    beam = np.exp(-vignetting * (x[None, :] ** 2 + y[:, None] ** 2))
    speckled = np.clip(seen, 0, None) * _speckle(draw, seen.shape, contrast, grain) * beam + 0.01
    noisy = speckled / np.percentile(speckled, 99) * 0.9 + noise * draw.standard_normal(seen.shape)
    return np.round(np.clip(noisy, 0, 1) ** (1 / 2.2) * 255).astype(np.float32) / 255


def unclipped(capture: Picture, draw: np.random.Generator) -> Picture:
    """A capture whose brightest samples are not equal, as they are where a camera clips them."""
    return np.where(capture < 0.85, capture, draw.uniform(0.6, 0.85, capture.shape)).astype(np.float32)


def drowned(
    picture: Picture, homography: Array, size: tuple[int, int], draw: np.random.Generator, haze: float = 0.7
) -> Picture:
    """A baseline as a camera stores it: full speckle, alike in all colours, on unmodulated light beside the picture.

    haze: mean of the unmodulated light over that of the picture.
    """
    light = np.clip(picture, 0, 1).mean(axis=0) ** 2.2
    light = (light + haze * light.mean()).astype(np.float32)
    seen = cv2.warpPerspective(light, homography, size[::-1]) * _speckle(draw, (1, *size), 1.0, 2.0)[0]
    levels = np.clip(seen / np.percentile(seen, 99), 0, 1) ** (1 / 2.2)
    return np.repeat(np.round(levels * 255)[None] / 255, 3, axis=0).astype(np.float32)


def _speckle(draw: np.random.Generator, shape: tuple[int, ...], contrast: float, grain: float) -> Array:
    if contrast == 0:
        return np.ones(shape)
    light = np.zeros(shape)
    for _ in range(max(1, round(1 / contrast**2))):
        fields = draw.standard_normal((2, *shape)).astype(np.float32)
        smooth = [[cv2.GaussianBlur(plane, (0, 0), grain) for plane in field] for field in fields]
        light += np.square(smooth).sum(axis=0)
    return light / light.mean()
