"""Why a session's camera cannot be registered: is the sign of the panel's phase the other one?

A reversed sign sends the picture to the other side of the panel: the camera sees the speckle of light that has gone
twice the distance too far, and perhaps a ghost of the grid. The nominal optics predict that speckle as well as they
predict the grid, so that a photograph tells which of the two it is, once it is known where the region lies in it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

from ...core.errors import CellError, UserError
from ...core.pictures import open_picture
from ...imaging.align import align
from ...imaging.circles import find_circles
from ...imaging.grid import fiducial
from ...imaging.warp import Warp
from ...methods.fiducials import HOLOGRAMS, STEPS
from ...optics.phase import blaze
from ..real import RealBench
from .checks import grain
from .folder import FolderPhotographer
from .frames import MOST_PIXELS
from .manifest import FIDUCIAL, FrameFile, Pattern, inside

Light = NDArray[np.float32]

SEEN, CLEARLY = 0.2, 2.0  # correlation of the grain with that of a reversed sign: at least, and times the other's
OUTLIER = 4.5  # region pixels of a circle from the homography


def sign_hint(bench: RealBench, photographer: FolderPhotographer) -> str:
    """The likely cause of a registration that failed, by the photographs of the fiducial grid."""
    sign = photographer.manifest.phase.sign
    if any(_is_reversed(bench, photographer, colour) for colour in range(len(bench.spec.wavelengths))):
        return (
            "the likely cause is the sign of the phase: the photographs look as the nominal optics predict for the "
            f"other one; set phase.sign: {-sign} in the bench file (session export --bench) and export a new session"
        )
    return (
        f"the photographs do not tell whether phase.sign: {sign} is right; the patterns in patterns/checks do; look at "
        "panel.distance, panel.pitch, the focus and the iris too"
    )


def _is_reversed(bench: RealBench, photographer: FolderPhotographer, colour: int) -> bool:
    patterns = [each for each in photographer.manifest.of_round(1) if (each.role, each.colour) == (FIDUCIAL, colour)]
    grid = np.asarray(bench.grid_photograph[colour].cpu().numpy(), dtype=np.float32)
    for number in range(HOLOGRAMS):
        shown = patterns[number * STEPS : (number + 1) * STEPS]
        light = np.asarray(np.mean([photographer.light(each) for each in shown], axis=0), dtype=np.float32)
        as_set, other = (predicted(bench, photographer, shown[0], sign) for sign in (1, -1))
        for warp in _poses(bench, grid, light, other):
            seen = grain(warp.sample(light))
            there = float(seen @ grain(other))
            if there > max(SEEN, CLEARLY * float(seen @ grain(as_set))):
                return True
    return False


def _poses(bench: RealBench, grid: Light, light: Light, other: Light) -> Iterator[Warp]:
    """Where the region may lie: by the ghost of the grid's circles, or by the speckle itself."""
    drawn = fiducial(bench.spec.region.shape)
    points = find_circles(grid, drawn)
    if points is not None:
        homography, _ = cv2.findHomography(drawn.centres, points, cv2.RANSAC, OUTLIER)
        if homography is not None:
            yield Warp(drawn.shape, np.asarray(homography, dtype=np.float64), np.zeros((6, 2)))
    try:
        yield align(_amplitude(light), _amplitude(other)).warp
    except CellError:
        return


def _amplitude(light: Light) -> Light:
    """Square root of the light as a picture ``(1, h, w)`` in [0, 1]."""
    amplitude = np.sqrt(np.maximum(light, 0))[None]
    return np.asarray(amplitude / max(float(amplitude.max()), 1e-12), dtype=np.float32)


def predicted(
    bench: RealBench, photographer: FolderPhotographer, pattern: Pattern, sign: int = 1
) -> NDArray[np.float32]:
    """Light ``(h, w)`` of a pattern in the region; sign: -1 for a panel whose phase has the other sign than stated.

    UserError for a pattern that is not as it was exported.
    """
    levels = np.stack([_levels(photographer.folder, frame) for frame in pattern.shown])
    shown = photographer.manifest.phase.of(pattern.colour).phase(levels).float()
    phase = sign * shown - blaze(bench.spec.shape, bench.carrier)
    field = bench.spec.propagator(pattern.colour).forward(torch.polar(torch.ones_like(phase), phase))
    return np.asarray(bench.spec.region.crop(field.abs().square().mean(0)).numpy())


def _levels(folder: Path, frame: FrameFile) -> NDArray[np.uint8]:
    path = inside(folder, frame.file)
    content = path.read_bytes() if path.is_file() else b""
    if hashlib.sha256(content).hexdigest() != frame.sha256:
        raise UserError(f"{path}: is not the pattern that was exported; put it back, or export a new session")
    return np.asarray(open_picture(content, MOST_PIXELS).values(), dtype=np.uint8)
