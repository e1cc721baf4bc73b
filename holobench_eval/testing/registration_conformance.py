"""Registration over random poses whose truth is known, and over pictures of something else (``holoeval conformance``).

What is asked of it: half of the poses to 0.2 px at the worst corner, none wrong by more than 1 px without saying so,
few refused, and every impostor refused.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import torch

from ..core.errors import CellError
from ..imaging.grid import fiducial
from ..imaging.register import register
from ..imaging.warp import Array
from .grid_poses import SHAPES, Pose, photograph, random_pose
from .synthetic_photos import beyond_the_sensor, impostors

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

    @property
    def silently_wrong(self) -> bool:
        """Wrong by more than a pixel, and it did not say so."""
        return self.error > SILENT_ERROR


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
    silent = any(each.silently_wrong for each in seen)
    return not silent and refused <= REFUSED and bool(np.nanmedian(corner_errors) <= MEDIAN_ERROR)


def _row(name: str, seen: list[Outcome]) -> None:
    corner_errors = errors(seen)
    finite = corner_errors[np.isfinite(corner_errors)]
    numbers = [*np.percentile(finite, (50, 95)), finite.max()] if len(finite) else [float("nan")] * 3
    text = "".join(f"{number:>9.3f}" for number in numbers)
    print(f"{name:<22}{len(seen):>6}{len(seen) - len(finite):>9}{text}")
