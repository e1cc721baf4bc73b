"""Registration over random poses whose truth is known, and over pictures of something else (``holoeval conformance``).

What is asked of it: half of the poses to 0.2 px at the worst corner, none wrong by more than 1 px without saying so,
few refused, and every impostor refused.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

from ..core.errors import CellError
from ..core.seeds import seed
from ..imaging.grid import MARK_RADIUS, RADIUS, fiducial
from ..imaging.register import register
from ..imaging.warp import Array, Frame
from .grid_poses import SHAPES, Pose, corner_points, photograph, random_pose, speckle

POSES = 200
MEDIAN_ERROR = 0.2  # region px
SILENT_ERROR = 1.0  # region px
REFUSED = 0.03  # of the poses
CONTRASTS = (0.0, 0.25, 0.5, 0.75, 1.0)


@dataclass(frozen=True)
class Outcome:
    """What registration made of one pose; error: largest of the corners [region px], NaN where it refused."""

    pose: Pose
    error: float


def outcome(pose: Pose) -> Outcome:
    """Register the photograph of one pose."""
    frame = torch.from_numpy(photograph(pose))
    try:
        registration = register(frame[None], fiducial(pose.shape))
    except CellError:
        return Outcome(pose, float("nan"))
    return Outcome(pose, pose.corner_error(registration.warps[0].corners()))


def outcomes(numbers: Iterable[int] = range(POSES)) -> list[Outcome]:
    """The outcome of each of the random poses with these numbers; about a tenth of a second each."""
    return [outcome(random_pose(number)) for number in numbers]


def errors(of: Iterable[Outcome]) -> Array:
    """Corner errors ``(N,)`` [region px], NaN where refused."""
    return np.array([each.error for each in of], dtype=np.float64)


def accepted_impostors(shape: tuple[int, int], number: int) -> tuple[list[str], int]:
    """Names of the impostors that registration took for the grid of ``shape`` (none is right), and how many there are.

    Regions that reach beyond the sensor are among them.
    """
    grid, pose = fiducial(shape), random_pose(number, shape)
    cases = list(impostors(shape, number))
    cases += [(f"{share:.0%} beyond the sensor", beyond_the_sensor(pose, share)) for share in (0.02, 0.1, 0.3)]
    accepted = []
    for name, frame in cases:
        try:
            register(torch.from_numpy(frame)[None], grid)
        except CellError:
            continue
        accepted.append(f"{shape[0]}x{shape[1]}: {name}")
    return accepted, len(cases)


def main(poses: int = POSES) -> int:
    """Print how registration does, by contrast and orientation; 1 if it does not do what is asked. Some minutes."""
    seen = outcomes(range(poses))
    print(f"{'registration':<22}{'poses':>6}{'refused':>9}{'median':>9}{'95 %':>9}{'worst':>9}  px at the worst corner")
    _row("all", seen)
    for low, high in pairwise(CONTRASTS):
        _row(f"contrast {low:g} to {high:g}", [each for each in seen if low <= each.pose.contrast < high])
    for turns in range(4):
        _row(f"{90 * turns} degrees", [each for each in seen if each.pose.quarter_turns == turns])
    for mirrored, name in ((False, "not mirrored"), (True, "mirrored")):
        _row(name, [each for each in seen if each.pose.mirrored == mirrored])
    checked = [accepted_impostors(shape, number) for number, shape in enumerate(SHAPES)]
    accepted = [name for names, _ in checked for name in names]
    print(f"impostors accepted: {len(accepted)} of {sum(count for _, count in checked)} {'; '.join(accepted)}".rstrip())
    passed = conforms(seen) and not accepted
    print("ok" if passed else "FAIL")
    return int(not passed)


def conforms(seen: list[Outcome]) -> bool:
    """Whether these outcomes are what is asked of registration."""
    corner_errors = errors(seen)
    refused = float(np.mean(np.isnan(corner_errors)))
    is_told = not (corner_errors > SILENT_ERROR).any()  # wherever it is wrong by more than a pixel
    return bool(is_told and refused <= REFUSED and np.nanmedian(corner_errors) <= MEDIAN_ERROR)


def _row(name: str, seen: list[Outcome]) -> None:
    corner_errors = errors(seen)
    finite = corner_errors[np.isfinite(corner_errors)]
    numbers = [*np.percentile(finite, (50, 95)), finite.max()] if len(finite) else [float("nan")] * 3
    text = "".join(f"{number:>9.3f}" for number in numbers)
    print(f"{name:<22}{len(seen):>6}{len(seen) - len(finite):>9}{text}")


def impostors(shape: tuple[int, int], number: int) -> Iterator[tuple[str, Frame]]:
    """Name and frame ``(Hs, Ws)`` of every kind of impostor of ``fiducial(shape)``, at random pose ``number``."""
    draw = np.random.default_rng(seed("impostors", shape, number))
    pose = random_pose(number, shape)
    grid = fiducial(shape)
    picture = grid.image.numpy()
    for grain in (1.0, 4.0, 12.0):
        yield f"speckle {grain:g} px wide", speckle(pose.sensor, 1.0, draw, finer=grain)
    y, x = np.indices(shape) // 18
    yield "checkerboard", photograph(pose, ((y + x) % 2).astype(np.float32))
    yield "grid without marks", photograph(pose, _discs(shape, grid.centres, grid.radius))
    yield (
        "grid with its marks shuffled",
        photograph(pose, _discs(shape, grid.centres, _radii(draw.permutation(grid.marks), grid.spacing))),
    )
    yield "finer grid", photograph(pose, _lattice(shape, 0.8))
    for other in _other_shapes(shape):
        yield f"grid of {other[0]}x{other[1]} px", photograph(random_pose(number, other))
    for name, window in _halves(shape):
        half = picture.copy()
        half[window] = 0
        yield f"grid without its {name} half", photograph(pose, half)
    hidden = draw.permutation(np.arange(len(grid.centres)) % 2 == 0)
    radii = np.where(hidden, 0.0, _radii(grid.marks, grid.spacing))
    yield "grid with every second circle hidden", photograph(pose, _discs(shape, grid.centres, radii))
    yield "grid and its mirror image", photograph(pose, (picture + picture[:, ::-1]) / 2)
    yield "grid and itself upside down", photograph(pose, (picture + picture[::-1, ::-1]) / 2)
    yield "two grids a third of a spacing apart", _two(pose, (grid.spacing / 3, 0.0))
    yield "two grids one spacing apart", _two(pose, (grid.spacing, 0.0))


def beyond_the_sensor(pose: Pose, share: float) -> Frame:
    """The photograph of a pose, cropped on one side so that about ``share`` of the region is outside the frame."""
    frame = photograph(pose)
    corners = cv2.perspectiveTransform(corner_points(pose.shape)[None], pose.homography)[0]
    left, right = corners[:, 0].min(), corners[:, 0].max()
    return np.ascontiguousarray(frame[:, round(left + share * (right - left)) :])


def _two(pose: Pose, apart: tuple[float, float]) -> Frame:
    moved = np.eye(3)
    moved[:2, 2] = apart
    other = replace(pose, homography=np.asarray(pose.homography @ moved, dtype=np.float64))
    return np.asarray((photograph(pose) + photograph(other)) / 2, dtype=np.float32)


def _radii(marks: NDArray[np.bool_], spacing: float) -> Array:
    return np.asarray(np.where(marks, MARK_RADIUS, RADIUS) * spacing)


def _discs(shape: tuple[int, int], centres: Array, radii: Array | float) -> Frame:
    y, x = np.mgrid[: shape[0], : shape[1]]
    image = np.zeros(shape)
    for (cx, cy), radius in zip(centres, np.broadcast_to(radii, len(centres)), strict=True):
        if radius > 0:
            image = np.maximum(image, np.clip((radius - np.hypot(x - cx, y - cy)) / 2 + 0.5, 0, 1))
    return np.asarray(image, dtype=np.float32)


def _lattice(shape: tuple[int, int], finer: float) -> Frame:
    """The whole region full of equal circles, ``finer`` times as far apart as the grid's."""
    grid = fiducial(shape)
    step = finer * grid.spacing
    x, y = np.meshgrid(np.arange(step, shape[1] - step / 2, step), np.arange(step, shape[0] - step / 2, step))
    return _discs(shape, np.stack([x, y], axis=-1).reshape(-1, 2), finer * grid.radius)


def _other_shapes(shape: tuple[int, int]) -> list[tuple[int, int]]:
    grid = fiducial(shape)
    shapes = [(160, 160), (192, 256), (130, 130), (128, 208), (256, 256), (96, 96), (shape[1], shape[0])]
    others = [fiducial(other) for other in dict.fromkeys(shapes)]
    return [other.shape for other in others if (other.columns, other.rows) != (grid.columns, grid.rows)]


def _halves(shape: tuple[int, int]) -> list[tuple[str, tuple[slice, slice]]]:
    middle = (shape[0] // 2, shape[1] // 2)
    full = slice(None)
    return [
        ("upper", (slice(None, middle[0]), full)),
        ("lower", (slice(middle[0], None), full)),
        ("left", (full, slice(None, middle[1]))),
        ("right", (full, slice(middle[1], None))),
    ]
