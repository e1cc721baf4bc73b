"""What the nominal optics predict of a pattern in a session folder."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from ...core.errors import UserError
from ...core.pictures import open_picture
from ...optics.phase import blaze
from ..real import RealBench
from .folder import FolderPhotographer
from .frames import MOST_PIXELS
from .manifest import FrameFile, Pattern, inside


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
