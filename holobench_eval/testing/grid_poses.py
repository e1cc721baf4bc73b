"""Photographs of a fiducial grid from known poses: what registration has to cope with, drawn at random.

Light in the region is the grid's picture times speckle, seen through a homography on a sensor of its own pitch, with
vignetting, stray light, shot and read noise. Nothing here is shared with the code that finds the grid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from ..core.seeds import seed
from ..imaging.grid import fiducial
from ..imaging.warp import Array, Frame

SHAPES = ((160, 160), (192, 256), (130, 130), (256, 160), (128, 208))
FINER = 3  # samples of the light for each region pixel
SUBPIXELS = 2  # samples for each sensor pixel and axis
GRAIN = 0.45  # standard deviation [region px] of the low pass on the speckle's field: grains about 1 px wide
DARKEST_CORNER = 0.3
STEEPEST = 0.10  # perspective: difference of opposite sides, of their mean
SCALES = (1.0, 2.5)  # sensor pixels a region pixel


@dataclass(frozen=True)
class Pose:
    """One photograph's circumstances.

    shape: (height, width) of the region; sensor: rows and columns; homography: ``(3, 3)``, region to sensor pixels,
    x before y; contrast: of the speckle in the light; corner: light in the sensor's corners relative to its middle;
    ambient: stray light relative to a circle's; electrons: of a circle in the middle, for shot noise; number: names
    the noise.
    """

    number: int
    shape: tuple[int, int]
    sensor: tuple[int, int]
    homography: Array
    quarter_turns: int
    mirrored: bool
    perspective: float
    scale: float
    contrast: float
    corner: float
    ambient: float
    electrons: float

    def corner_error(self, corners: Array) -> float:
        """Largest distance [region px] of the region's corners from where ``corners`` ``(4, 2)`` [sensor px] are.

        Order of the corners as in `Warp.corners`.
        """
        measured = _mapped(np.asarray(np.linalg.inv(self.homography), dtype=np.float64), corners)
        return float(np.linalg.norm(measured - corner_points(self.shape), axis=1).max())


def corner_points(shape: tuple[int, int]) -> Array:
    """Centres ``(4, 2)`` of the corner pixels of a region: left and right above, left and right below."""
    bottom, right = shape[0] - 1.0, shape[1] - 1.0
    return np.array([[0.0, 0.0], [right, 0.0], [0.0, bottom], [right, bottom]])


def random_pose(number: int, shape: tuple[int, int] | None = None) -> Pose:
    """Pose ``number`` of a fixed random series; every orientation comes up equally often."""
    draw = np.random.default_rng(seed("fiducial pose", number))
    shape = shape or SHAPES[number // 8 % len(SHAPES)]
    quarter_turns, mirrored = number % 4, bool(number // 4 % 2)
    scale = draw.uniform(*SCALES)
    angle = math.radians(90 * quarter_turns + draw.uniform(-6, 6))
    perspective, towards = draw.uniform(0, STEEPEST), draw.uniform(0, math.tau)
    tilt = np.eye(3)
    tilt[2, :2] = perspective * np.array([math.cos(towards), math.sin(towards)]) / (shape[1], shape[0])
    centred = np.array([[1, 0, -(shape[1] - 1) / 2], [0, 1, -(shape[0] - 1) / 2], [0, 0, 1]])
    mirror = np.diag([-1.0 if mirrored else 1.0, 1.0, 1.0])
    turn = np.array([[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1]])
    skew = np.eye(3)
    skew[:2, :2] += draw.uniform(-0.02, 0.02, (2, 2))
    homography = np.diag([scale, scale, 1.0]) @ skew @ turn @ mirror @ tilt @ centred
    corners = _mapped(homography, corner_points(shape))
    low, size = corners.min(axis=0), np.ptp(corners, axis=0)
    room = size * draw.uniform(0.08, 0.6, 2) + 8
    sensor = np.ceil(size + room).astype(int)
    offset = np.eye(3)
    offset[:2, 2] = 4 + draw.uniform(0, 1, 2) * (room - 8) - low
    return Pose(
        number=number,
        shape=shape,
        sensor=(int(sensor[1]), int(sensor[0])),
        homography=offset @ homography,
        quarter_turns=quarter_turns,
        mirrored=mirrored,
        perspective=perspective,
        scale=scale,
        contrast=draw.uniform(0, 1),
        corner=draw.uniform(DARKEST_CORNER, 1),
        ambient=draw.uniform(0, 0.15),
        electrons=draw.uniform(500, 10000),
    )


def photograph(pose: Pose, picture: Frame | None = None) -> Frame:
    """The sensor's frame ``(Hs, Ws)``, a circle in the middle at about 1.

    picture: ``(h, w)`` linear light, another target than the grid.
    """
    draw = np.random.default_rng(seed("fiducial photograph", pose.number))
    wanted = fiducial(pose.shape).image.numpy() if picture is None else picture
    finer = cv2.resize(wanted, None, fx=FINER, fy=FINER, interpolation=cv2.INTER_LINEAR)  # pixel areas kept
    light = finer * speckle((finer.shape[0], finer.shape[1]), pose.contrast, draw)
    rows, columns = ((np.arange(side * SUBPIXELS) + 0.5) / SUBPIXELS - 0.5 for side in pose.sensor)
    points = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(1, -1, 2)
    region = cv2.perspectiveTransform(points, np.linalg.inv(pose.homography)).reshape(len(rows), len(columns), 2)
    where = ((region + 0.5) * FINER - 0.5).astype(np.float32)
    fine = cv2.remap(light, where[..., 0], where[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    seen = cv2.resize(np.asarray(fine), (pose.sensor[1], pose.sensor[0]), interpolation=cv2.INTER_AREA)
    y, x = (np.linspace(-1, 1, side) for side in pose.sensor)
    lens = pose.corner ** ((x**2 + y[:, None] ** 2) / 2)
    counts = (np.asarray(seen) + pose.ambient) * lens * pose.electrons
    counts = counts + np.sqrt(np.maximum(counts, 0)) * draw.standard_normal(pose.sensor)
    counts += 0.005 * pose.electrons * draw.standard_normal(pose.sensor)
    return np.asarray(counts / pose.electrons, dtype=np.float32)


def speckle(shape: tuple[int, int], contrast: float, draw: np.random.Generator, finer: float = FINER) -> Frame:
    """Speckle of mean 1: a constant phasor plus a circular Gaussian field, `GRAIN` wide at ``finer`` samples a pixel.

    Contrast 1 is fully developed; below it the constant phasor carries the rest (Goodman, Speckle Phenomena, 3.2.2).
    """
    field = [cv2.GaussianBlur(draw.standard_normal(shape), (0, 0), GRAIN * finer) for _ in range(2)]
    real, imaginary = (np.asarray(part) / np.sqrt(2 * np.mean(np.square(part))) for part in field)
    random = 1 - math.sqrt(1 - contrast**2)
    intensity = (math.sqrt(1 - random) + math.sqrt(random) * real) ** 2 + random * imaginary**2
    return np.asarray(intensity, dtype=np.float32)


def _mapped(homography: Array, points: Array) -> Array:
    return np.asarray(cv2.perspectiveTransform(points.reshape(1, -1, 2), homography)[0], dtype=np.float64)
