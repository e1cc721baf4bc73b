"""Captures with a known warp: a picture as a hologram shows it, speckled, on a sensor of its own pitch and pose."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from holobench_eval.core.seeds import seed
from tests.support.photographed import mapped

Array = NDArray[np.float64]
FINER = 3  # samples of the light for each panel pixel
SUBPIXELS = 2  # samples for each sensor pixel and axis
MARGIN = 24  # panel pixels around the region


def random(*names: object) -> np.random.Generator:
    return np.random.default_rng(seed("simulated grid", *names))


@dataclass(frozen=True)
class Pose:
    """Region pixels to sensor pixels: a homography after an optional bend ``(6, 2)`` quadratic in -1 to 1."""

    homography: Array
    shape: tuple[int, int]
    bend: Array

    def bent(self, points: Array) -> Array:
        u = points[:, 0] / (0.5 * (self.shape[1] - 1)) - 1
        v = points[:, 1] / (0.5 * (self.shape[0] - 1)) - 1
        return points + np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=1) @ self.bend

    def to_sensor(self, points: Array) -> Array:
        return mapped(self.homography, self.bent(points))

    def to_region(self, points: Array) -> Array:
        wanted = mapped(np.linalg.inv(self.homography), points)
        if not self.bend.any():
            return wanted
        found = wanted
        for _ in range(6):
            found = found + wanted - self.bent(found)
        return found


def pose(
    draw: np.random.Generator,
    shape: tuple[int, int],
    sensor: tuple[int, int],
    scale: float = 1.72,
    quarter_turns: int | None = None,
    mirrored: bool | None = None,
    bend: Array | None = None,
) -> Pose:
    """Up to 3 degrees of rotation, 6 px of shift and 2 % of perspective around the quarter turns and mirrors."""
    quarter_turns = int(draw.integers(4)) if quarter_turns is None else quarter_turns
    mirrored = bool(draw.integers(2)) if mirrored is None else mirrored
    angle = np.deg2rad(draw.uniform(-3, 3) + 90 * quarter_turns)
    centre = np.array([[1, 0, -(shape[1] - 1) / 2], [0, 1, -(shape[0] - 1) / 2], [0, 0, 1]])
    mirror = np.diag([-1.0 if mirrored else 1.0, 1.0, 1.0])
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    tilt = np.eye(3)
    tilt[2, :2] = draw.uniform(-0.02, 0.02, 2) / max(shape)
    place = np.diag([scale, scale, 1.0])
    place[:2, 2] = np.array([(sensor[1] - 1) / 2, (sensor[0] - 1) / 2]) + draw.uniform(-6, 6, 2)
    return Pose(place @ tilt @ turn @ mirror @ centre, shape, np.zeros((6, 2)) if bend is None else bend)


def light(picture: Array, draw: np.random.Generator, contrast: float) -> NDArray[np.float32]:
    """The intensity of a band-limited field of random phase, ``FINER`` times as fine; contrast 0: the picture."""
    if contrast == 0:
        y, x = (np.arange(side * FINER, dtype=np.float32) / FINER for side in picture.shape)
        return cv2.remap(picture.astype(np.float32), *np.meshgrid(x, y), cv2.INTER_CUBIC)
    looks = round(1 / contrast**2)
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(picture.shape[1]), np.fft.fftfreq(picture.shape[0])))
    total = np.zeros([side * FINER for side in picture.shape])
    for _ in range(looks):
        field = np.sqrt(picture) * np.exp(2j * np.pi * draw.random(picture.shape))
        band = np.fft.fftshift(np.fft.fft2(field) * (frequency <= 0.35))
        padded = np.zeros(total.shape, dtype=complex)
        top, left = (whole // 2 - part // 2 for whole, part in zip(total.shape, picture.shape, strict=True))
        padded[top : top + picture.shape[0], left : left + picture.shape[1]] = band
        total += np.abs(np.fft.ifft2(np.fft.ifftshift(padded))) ** 2
    return (total * picture.mean() / total.mean()).astype(np.float32)


def capture(
    picture: Array,
    where: Pose,
    sensor: tuple[int, int],
    draw: np.random.Generator,
    contrast: float = 1.0,
    uneven: bool = True,
    background: float = 0.0,
    noise: float = 0.01,
    outside: float = 0.0,
) -> NDArray[np.float32]:
    """What a sensor sees of a region's picture: Gaussian beam with fringes, stray light, pixel integration, noise."""
    panel = np.pad(picture, MARGIN, constant_values=outside)
    fine = light(panel, draw, contrast)
    y, x = ((np.arange(side * SUBPIXELS) + 0.5) / SUBPIXELS - 0.5 for side in sensor)
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    at = ((where.to_region(points) + MARGIN) * FINER).astype(np.float32).reshape(len(y), len(x), 2)
    seen = cv2.remap(fine, at, None, cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT, borderValue=0)
    seen = seen.reshape(sensor[0], SUBPIXELS, sensor[1], SUBPIXELS).mean(axis=(1, 3))
    if uneven:
        v, u = (np.linspace(0, 1, side) for side in sensor)
        v, u = v[:, None] - draw.uniform(0.35, 0.65), u[None, :] - draw.uniform(0.35, 0.65)
        across, down = draw.uniform(-0.02, 0.02, 2) * (sensor[1], sensor[0])
        fringes = 1 + 0.1 * np.cos(2 * np.pi * (across * u + down * v))
        seen = seen * np.exp(-(u**2 + v**2) / (2 * 0.35**2)) * fringes
    bright = float(np.percentile(seen, 99))
    seen = seen + background * bright + noise * bright * draw.standard_normal(sensor)
    return seen.astype(np.float32)
