"""Read one photograph that somebody put into a session folder: linear counts, and what its file says of them."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from ...core.errors import UserError
from ...core.io import read_regular
from ...optics.colour import srgb_decode
from ..counts import read_counts, step
from .manifest import SUFFIXES, inside

MOST_PIXELS = 200_000_000  # more would be the bomb of a hostile file
LARGEST_FILE = 1 << 30  # bytes

Plane = NDArray[np.float32]


@dataclass(frozen=True)
class Frame:
    """A photograph of one colour.

    counts: ``(Hs, Ws)`` float32; top: the largest count that the file's format can hold, or the sensor's white level
    where a RAW file tells it; step: all counts are multiples of it (16 for 12 bits at the upper end of 16; 0: dark);
    sha256: of the file; linear: whether the counts are proportional to light (a JPEG's were decoded from sRGB).
    """

    counts: Plane
    top: float
    step: int
    sha256: str
    linear: bool

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.counts.shape[0], self.counts.shape[1]


@dataclass(frozen=True)
class Facts:
    """What is kept of a photograph while a series is checked: see ``Frame``.

    mean, highest: of its counts; at_highest: the fraction of samples with that count, or with ``top`` and above;
    content: sha256 of the counts, which a time stamp in the file does not change.
    """

    shape: tuple[int, int]
    mean: float
    highest: float
    at_highest: float
    top: float
    step: int
    sha256: str
    content: str
    linear: bool


def facts(frame: Frame) -> Facts:
    """The facts of a photograph."""
    highest = min(float(frame.counts.max()), frame.top)
    share = float((frame.counts >= highest).mean())
    mean = float(frame.counts.mean(dtype=np.float64))
    content = hashlib.sha256(frame.counts.tobytes()).hexdigest()
    return Facts(frame.shape, mean, highest, share, frame.top, frame.step, frame.sha256, content, frame.linear)


def find(folder: Path, capture: str) -> Path | None:
    """The file of a photograph, by its name without ending; None if there is none. UserError for several."""
    files = [path for ending in SUFFIXES for path in _endings(folder / f"{capture}{ending}") if path.is_file()]
    if len(files) > 1:
        raise UserError(f"{folder / capture}: {', '.join(path.name for path in files)}: keep one of these")
    return inside(folder, str(files[0].relative_to(folder))) if files else None


def _endings(path: Path) -> list[Path]:
    """The name with a small and with a capital ending, each once on file systems that do not tell them apart."""
    capital = path.with_suffix(path.suffix.upper())
    return [path, *([capital] if not (path.exists() and capital.exists() and path.samefile(capital)) else [])]


def read_frame(path: Path, colour: int) -> Frame:
    """A photograph; of a colour camera's three channels the one of index ``colour``. UserError for a bad file."""
    content = read_regular(path, LARGEST_FILE)
    sha256 = hashlib.sha256(content).hexdigest()
    frame = read_counts(content, path, linear=True, upright=False, largest=MOST_PIXELS)
    if frame.values.dtype.kind == "f":
        raise UserError(f"{path}: floating point, which has no full scale; expected counts of 8 or 16 bits")
    plane = frame.values[colour if len(frame.values) > 1 else 0]
    counts = np.ascontiguousarray(plane, dtype=np.float32)
    if frame.is_lossy:
        light = srgb_decode(torch.from_numpy(counts / np.float32(255))).numpy() * np.float32(255)
        return Frame(light, 255.0, 1, sha256, linear=False)
    return Frame(counts, frame.white, 1 if frame.is_raw else step(plane), sha256, linear=True)
